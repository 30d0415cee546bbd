"""What ``world check --noise`` prints."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from sva_bench.cli.loading import loading
from sva_bench.cli.sheets import Column, Sheet, print_sheet
from sva_bench.cli.terminal import print_json, progress_bars, results
from sva_bench.files.outputs import write_result
from sva_bench.files.printable import counted

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rich.console import Console

    from sva_bench.analysis.tightness import LegTightness, MarginQuantiles, PlanTightness
    from sva_bench.choices import Judgement
    from sva_bench.travel.fuel import FuelCosts
    from sva_bench.world.model import World


def check_under_noise(
    world: World, costs: Mapping[str, FuelCosts], plan: Path | None, picture: Path | None, *, draws: int, seed: int,
    as_json: bool, wide: bool,
) -> None:
    """Drive plans under noise, print what it leaves of their margins, and draw the worst of them."""
    with loading():
        from sva_bench.files.records import as_dict
        from sva_bench.study.given_plans import read_plans
        from sva_bench.study.noise_check import check_noise, picture_of_margins, worst_of
        from sva_bench.study.planning import check_plans

    given = {} if plan is None else read_plans(world, {plan.stem: plan})
    with progress_bars() as progress:
        if plan is not None:
            check_plans(world, costs, given, {plan.stem: plan}, allow_infeasible=True)
        checked = check_noise(world, costs, given, draws=draws, seed=seed, progress=progress)
    if as_json:
        print_json(as_dict(checked.found))
    else:
        for told in checked.found.plans:
            _print_plan(told, draws, results(), wide=wide)
    if picture is not None:
        worst = worst_of(checked)
        write_result(picture, picture_of_margins(world, costs, checked.plans[worst], checked.found.plans[worst],
                                                 "svg" if picture.suffix.lower() == ".svg" else "png"))
        if not as_json and len(checked.plans) > 1:
            results().print(f"{picture} shows the plan of {', '.join(checked.found.plans[worst].scenarios)}, which "
                            "noise upsets most often", highlight=False)


def _print_plan(told: PlanTightness, draws: int, console: Console, *, wide: bool) -> None:
    rows = []
    for leg in told.worst_first:
        driven = leg.driven_s
        rows.append([leg.robot, f"{leg.leg}, {leg.origin} to {leg.destination}", f"{leg.planned_s:.1f}",
                     "–" if driven is None else f"{driven.q05:.1f} {driven.q50:.1f} {driven.q95:.1f}",
                     _left(leg.fuel_margin_s), _left(leg.time_margin_s),
                     *(f"{100 * share:.1f} %" if share else "" for share in (leg.dry, leg.late, leg.stuck)),
                     _JUDGED[leg.judged]])
    spare = {"driven 5, 50, 95 % [s]": 5, "planned [s]": 4, "stuck": 3, "late": 2, "dry": 1}
    print_sheet(Sheet(
        title=f"{told.plan}, {', '.join(told.scenarios)}: legs under {counted(draws, 'noise draw')}", rows=rows,
        columns=[Column(heading=heading, words=k in (0, 1, 9), above=k < 2, last=spare.get(heading, 0))
                 for k, heading in enumerate((
                     "robot", "leg", "planned [s]", "driven 5, 50, 95 % [s]", "fuel left 1, 5 % [s]",
                     "time left 1, 5 % [s]", "dry", "late", "stuck", ""))]), console, wide=wide)
    edge = [leg for leg in told.legs if leg.judged == "edge"]
    console.print(f"{told.plan}, {', '.join(told.scenarios)}: some robot runs dry, is late or gets stuck in "
                  f"{100 * told.bad:.1f} % of draws; {_edge_told(edge)}", highlight=False, markup=False)


_JUDGED: dict[Judgement, str] = {"safe": "", "close": "little margin", "edge": "knife's edge"}


def _edge_told(edge: list[LegTightness]) -> str:
    if not edge:
        return "no leg goes wrong in more than 1 %"
    worst = max(edge, key=lambda leg: leg.wrong)
    return (f"{counted(len(edge), 'leg')} on a knife's edge, the worst of {worst.robot} from {worst.origin} to "
            f"{worst.destination}")


def _left(margin: MarginQuantiles | None) -> str:
    if margin is None:
        return "no limit"
    return " ".join("–" if value is None else f"{value:z.1f}" for value in (margin.q01, margin.q05))
