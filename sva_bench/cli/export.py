"""The command that writes plans for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sva_bench.choices import EXPORT_FORMATS, ExportFormat
from sva_bench.cli.loading import loading
from sva_bench.cli.options import InteractionOption, Verbose
from sva_bench.cli.terminal import progress_bars, set_up_logging
from sva_bench.files.outputs import check_output, write_result


def export(
    plan: Annotated[Path, typer.Argument(metavar="PLAN", help="Plan file (JSON or CSV).", show_default=False)],
    world: Annotated[Path, typer.Option(metavar="WORLD", help="World file (YAML) that it is a plan for.",
                                        show_default=False)],
    to: Annotated[ExportFormat, typer.Option(help="What for. " + "; ".join(
        f"{name}: {said}" for name, said in EXPORT_FORMATS.items()) + ".", show_default=False)],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="File to write; default: standard output.",
                                                show_default=False)] = None,
    robot: Annotated[str | None, typer.Option(help="Only this robot's route.", show_default="all that leave")] = None,
    interaction: InteractionOption = None,
    verbose: Verbose = False,
) -> None:
    """Write a plan for other programs: Nav2 waypoints, GeoJSON, CSV."""
    with loading():
        from sva_bench.study.given_plans import read_plans
        from sva_bench.study.inputs import about, load

    set_up_logging(verbose)
    check_output(output, world, plan)
    loaded = load(world, interaction=interaction)
    read = read_plans(loaded, {"plan": plan})["plan"]
    with loading():
        from sva_bench.study.costs import plan_costs
        from sva_bench.study.exports import EXPORTS, Exported
        from sva_bench.study.planning import check_plans

    with about(world), progress_bars() as progress:
        costs = plan_costs(loaded, "prmstar", progress)
        check_plans(loaded, costs, {"plan": read}, {"plan": plan}, allow_infeasible=True)
        content = EXPORTS[to](Exported(world=loaded, costs=costs, plan=read, robot=robot))
    write_result(output, content)
