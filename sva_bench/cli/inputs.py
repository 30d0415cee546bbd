"""Commands that check, make and copy worlds, and make instances."""

from __future__ import annotations

import logging
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sva_bench.choices import InstanceFamily, PathPlanner, Unknown, WorldFamily
from sva_bench.cli.loading import loading
from sva_bench.cli.options import (
    AsJson,
    Force,
    InteractionOption,
    PlannerOption,
    ScenarioNames,
    Verbose,
    Wide,
    WorldArgument,
    finite,
)
from sva_bench.cli.terminal import (
    messages,
    print_hanging,
    print_json,
    progress_bars,
    refuse_closed_output,
    results,
    say_written,
    set_up_logging,
)
from sva_bench.cli.usage import PlainCommand, PlainGroup
from sva_bench.errors import BadInput
from sva_bench.files.outputs import check_output, write_beside, write_result
from sva_bench.files.printable import counted
from sva_bench.files.seal import refuse_edited, refuse_others, sealed
from sva_bench.interrupts import holding_back_ctrl_c
from sva_bench.study.bounds import MOST_DRAWS, MOST_SEED

if TYPE_CHECKING:
    from collections.abc import Mapping

    from sva_bench.travel.fuel import FuelCosts
    from sva_bench.world.model import World

_log = logging.getLogger(__name__)

world_app = typer.Typer(cls=PlainGroup, no_args_is_help=True, help="Check, make, copy and draw worlds.",
                        rich_markup_mode="rich")
instance_app = typer.Typer(cls=PlainGroup, no_args_is_help=True, help="Make instances.",
                           rich_markup_mode="rich")


@world_app.command("check", cls=PlainCommand)
def check_world(
    world: WorldArgument,
    noise: Annotated[bool, typer.Option("--noise", help="Drive the plans under noise, by the twin, and say on which "
                                        "legs fuel and time are tight.")] = False,
    plan: Annotated[Path | None, typer.Option(metavar="PLAN.json", help="With --noise: this plan.",
                                              show_default="the stochastic plan of each scenario")] = None,
    draws: Annotated[int | None, typer.Option(min=1, max=MOST_DRAWS, help="With --noise: how many noise draws.",
                                              show_default="200")] = None,
    seed: Annotated[int | None, typer.Option(min=0, max=MOST_SEED, help="With --noise: their seed.",
                                             show_default="0")] = None,
    scenario: ScenarioNames = None,
    interaction: InteractionOption = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", metavar="PICTURE.png|svg", help="With --noise: draw "
                                                "the legs of the tightest plan, coloured by their margin.",
                                                show_default="none")] = None,
    as_json: AsJson = False,
    wide: Wide = False,
    planner: PlannerOption = "prmstar",
    verbose: Verbose = False,
) -> None:
    """Check a world: is the file right, does every robot reach every site, and what can't be part of any plan?

    With --noise: what does noise leave of the margins of its plans?
    """
    with loading():
        from sva_bench.study.inputs import about, load

    set_up_logging(verbose)
    refuse_closed_output()
    if not noise and (lone := [name for name, given in (
            ("--plan", plan), ("--draws", draws), ("--seed", seed), ("--scenario", scenario), ("--output", output),
            ("--json", as_json or None)) if given is not None]):
        raise BadInput(f"{lone[0]} belongs to --noise: add that, or leave it out")
    if output is not None:
        _kind_of(output)
        check_output(output, world)
    loaded = load(world, scenario, interaction=interaction)
    if noise:
        _check_noise(loaded, world, planner, plan, output, draws or 200, seed or 0, as_json=as_json,
                     wide=wide)
        return
    with loading():
        from sva_bench.analysis.reach import beyond_reach, why_nothing
        from sva_bench.report.stands import interaction_lines, stands_of
        from sva_bench.study.costs import plan_costs, reach_of

    with about(world), progress_bars() as progress:
        stands = stands_of(loaded)
        costs = plan_costs(loaded, planner, progress)
    _warn_of_doubtful(loaded, costs)
    console = results()
    for kind, cost in costs.items():
        longest = int(cost.repaired_ms.max()) / 1000
        console.print(f"{kind}: {counted(cost.pairs, 'travel time')} of up to {longest:.1f} s, "
                      f"{cost.changed_pct:.1f} % repaired; paths keep {cost.times.clearance_m:.3f} m from obstacles",
                      highlight=False)
    if loaded.reaction.policy != "none":
        console.print(f"the team reacts to failures: policy {loaded.reaction.policy}, news {loaded.reaction.news}",
                      highlight=False)
    for said in interaction_lines(loaded, stands):
        console.print(said, highlight=False, markup=False)
    reach = reach_of(loaded, costs)
    for said in beyond_reach(reach):
        console.print(said, highlight=False, markup=False)
    verdict = f"can be read, but {why_nothing(reach)}" if reach.nothing else "is a good world"
    counts = {"station": len(loaded.stations), "POI": len(loaded.pois), "robot": len(loaded.robots),
              "scenario": len(loaded.scenarios)}
    console.print(f"{loaded.name} {verdict}: "
                  + ", ".join(counted(count, what) for what, count in counts.items()), highlight=False)


def _kind_of(picture: Path) -> str:
    """``png`` or ``svg``.

    Raises:
        BadInput: If the name says neither.
    """
    kind = picture.suffix.lower()[1:]
    if kind not in ("png", "svg"):
        raise BadInput(f"{picture}: pictures are written as PNG or SVG; let the name end in .png or .svg")
    return kind


def _warn_of_doubtful(world: World, costs: Mapping[str, FuelCosts]) -> None:
    """Say what can't be what was meant."""
    with loading():
        from sva_bench.study.doubtful import doubtful_berths, doubtful_loads, doubtful_passages

    for said in (*doubtful_passages(world, costs), *doubtful_berths(world), *doubtful_loads(world)):
        _log.warning("%s", said)


def _check_noise(loaded: World, path: Path, planner: PathPlanner, plan: Path | None, output: Path | None, draws: int,
                 seed: int, *, as_json: bool, wide: bool) -> None:
    """The check under noise."""
    with loading():
        from sva_bench.cli.noise_check import check_under_noise
        from sva_bench.study.costs import plan_costs
        from sva_bench.study.inputs import about
        from sva_bench.study.noise_check import refuse_without_noise

    refuse_without_noise(loaded)
    with about(path):
        with progress_bars() as progress:
            costs = plan_costs(loaded, planner, progress)
        _warn_of_doubtful(loaded, costs)
        check_under_noise(loaded, costs, plan, output, draws=draws, seed=seed, as_json=as_json, wide=wide)


@world_app.command("random", cls=PlainCommand)
def make_random_world(
    family: Annotated[WorldFamily, typer.Option(help="What stands there: walls with doors and furniture, scattered "
                                                     "obstacles, racks, or a maze.")] = "rooms",
    size: Annotated[float, typer.Option(metavar="METRES", min=10, max=100, callback=finite, help="Side of the "
                                        "square.")] = 18,
    density: Annotated[float | None, typer.Option(
        min=0, max=1, callback=finite, help="Share of the area that furniture, obstacles or racks cover; of a maze, "
        "share of its walls that stand: 1 leaves no loops.", show_default="rooms 0.06, field 0.1, aisles 0.2, "
        "maze 0.8")] = None,
    pois: Annotated[int, typer.Option(min=4, max=100, help="Points of interest, at least two for each robot.")] = 10,
    stations: Annotated[int, typer.Option(min=0, max=30, help="Refuelling stations.")] = 5,
    robots: Annotated[int, typer.Option(min=2, max=10, help="Robots; half of them, rounded down, are uncertain.")] = 2,
    seed: Annotated[int, typer.Option(min=0, max=MOST_SEED, help="Seed of terrain, sites and incentives.")] = 0,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="World file to write; default: standard "
                                                "output.", show_default=False)] = None,
    force: Force = False,
    verbose: Verbose = False,
) -> None:
    """Make a random world, with a mission that is neither trivial nor hopeless and the paper's scenarios S1 to S4."""
    with loading():
        from sva_bench.generate.worlds import random_world

    set_up_logging(verbose)
    check_output(output)
    if output is not None:
        refuse_edited(output, force=force)
    with progress_bars() as progress:
        text = random_world(family, size_m=size, density=density, pois=pois, stations=stations, robots=robots,
                            seed=seed, progress=progress)
    write_result(output, sealed(text))


@world_app.command("from-map", cls=PlainCommand)
def make_world_from_map(
    source: Annotated[Path, typer.Argument(metavar="MAP.yaml|MAP.map", help="YAML file of a ROS map, or a MovingAI "
                                           "map.", show_default=False)],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="WORLD.yaml", help="World file to write; the map's "
                                         "files are copied beside it, to WORLD-map/.", show_default=False)],
    pois: Annotated[int, typer.Option(min=4, max=100, help="Points of interest, at least two for each robot.")] = 20,
    stations: Annotated[int, typer.Option(min=0, max=30, help="Refuelling stations.")] = 5,
    robots: Annotated[int, typer.Option(min=2, max=10, help="Robots; half of them, rounded down, are uncertain.")] = 2,
    base: Annotated[tuple[float, float] | None, typer.Option(
        metavar="X Y", help="Where the base is, in metres of the map; what it can't reach gets no sites.",
        show_default="the middle of the largest region that walls enclose")] = None,
    min_spacing: Annotated[float | None, typer.Option(
        metavar="METRES", min=0.05, max=1000, callback=finite, help="From one point of interest to the next and to all "
        "other sites, at least.", show_default="as wide as it easily goes")] = None,
    cell_m: Annotated[float | None, typer.Option(
        metavar="METRES", min=1e-3, max=100, callback=finite, help="Side of a cell of a MovingAI map.",
        show_default="1.0")] = None,
    unknown: Annotated[Unknown | None, typer.Option(help="What unknown cells of a ROS map count as.",
                                                    show_default="occupied")] = None,
    seed: Annotated[int, typer.Option(min=0, max=MOST_SEED, help="Seed of points of interest and incentives.")] = 0,
    force: Force = False,
    verbose: Verbose = False,
) -> None:
    """Make a world of a map, with sites on free ground, a mission that suits it and the paper's scenarios S1 to S4."""
    with loading():
        from sva_bench.generate.worlds import world_from_map
        from sva_bench.study.inputs import refuse_no_map
        from sva_bench.world.maps.formats import format_of, settings_for

    set_up_logging(verbose)
    settings = settings_for(format_of(source), {"cell_m": cell_m, "unknown": unknown})
    if base is not None and not all(map(math.isfinite, base)):
        raise BadInput("--base: expected two finite numbers")
    check_output(output, source)
    refuse_edited(output, force=force)
    refuse_no_map(source)
    with progress_bars() as progress:
        text, files = world_from_map(
            source, output, base=base, pois=pois, stations=stations, robots=robots, seed=seed, spacing_m=min_spacing,
            settings=settings, progress=progress)
    if not force:
        refuse_others(output, {file.name: file.content for file in files})
    with holding_back_ctrl_c():  # a map and the world on it belong together
        for file in files:  # before the world that names them
            write_beside(output, file.name, file.content)
        write_result(output, sealed(text))
    say_written(output)


@world_app.command("example", cls=PlainCommand)
def copy_example(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="Which of them.", show_default=False)] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", metavar="WORLD.yaml", help="World file to write; "
                                                "default: standard output.", show_default=False)] = None,
    listed: Annotated[bool, typer.Option("--list", help="List them, each with its plans.")] = False,
    force: Force = False,
) -> None:
    """Copy one of the shipped worlds, to run or to change."""
    with loading():
        from sva_bench.generate.examples import example_names, example_plans, example_title, example_world

    if listed:
        if name is not None or output is not None:
            raise BadInput("--list takes neither a name nor -o")
        refuse_closed_output()
        width = max(map(len, example_names()))
        for each in example_names():
            print_hanging(example_title(each), f"{each:{width}}  ")
            for plan in example_plans(each):
                typer.echo(f"{'':{width}}  {plan}")
        return
    if name is None:
        raise BadInput(f"say which world: {', '.join(example_names())}; --list says more of them")
    text = example_world(name).read_text(encoding="utf-8")
    check_output(output)
    if output is not None:
        refuse_edited(output, force=force)
    write_result(output, sealed(text))
    for plan in example_plans(name):
        messages.print(f"a plan for it: {plan}", highlight=False, markup=False, soft_wrap=True)


@world_app.command("draw", cls=PlainCommand)
def draw(
    world: WorldArgument,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="PICTURE.png|svg", help="Picture to write.",
                                         show_default=False)],
    roadmap: Annotated[bool, typer.Option("--roadmap", help="Show the roadmap that paths are planned on, that of the "
                                                 "widest robot.")] = False,
    paths: Annotated[bool, typer.Option("--paths", help="Show the paths between all sites, of all robots.")] = False,
    plan: Annotated[Path | None, typer.Option(metavar="PLAN.json", help="Show the routes of a plan.",
                                              show_default="none")] = None,
    interaction: InteractionOption = None,
    verbose: Verbose = False,
) -> None:
    """Draw a world to scale: map, sites, incentives; on request roadmap, paths and a plan's routes."""
    kind = _kind_of(output)
    with loading():
        from sva_bench.study.inputs import about, load

    set_up_logging(verbose)
    check_output(output, world)
    loaded = load(world, interaction=interaction)
    check_output(output, *(world.parent / file.name for file in loaded.files))  # a map may be a picture of that name
    with loading():
        from sva_bench.study.given_plans import read_plans

    read = None if plan is None else read_plans(loaded, {"plan": plan})["plan"]
    with loading():
        from sva_bench.study.pictures import picture_of

    with about(world), progress_bars() as progress:
        content = picture_of(loaded, "svg" if kind == "svg" else "png", roadmap=roadmap, paths=paths,
                             progress=progress, plan=read, plan_file=plan)
    write_result(output, content)


@world_app.command("schema", cls=PlainCommand)
def world_schema() -> None:
    """Print the JSON schema of world files, for editors."""
    with loading():
        from sva_bench.world.schema import WorldFile

    print_json(WorldFile.model_json_schema())


@instance_app.command("random", cls=PlainCommand)
def random_instances(
    family: Annotated[InstanceFamily, typer.Option(help="A: one filling lasts for the mission; B: two to five refuels; "
                                                        "C: short routes.")] = "A",
    pois: Annotated[int, typer.Option(min=0, max=1000, help="Points of interest.")] = 20,
    vehicles: Annotated[int, typer.Option(min=0, max=100, help="Vehicles; every second one is uncertain.")] = 2,
    availability: Annotated[float, typer.Option(min=0, max=1, callback=finite, help="Availability of the uncertain "
                                                "ones.")] = 0.75,
    fuel: Annotated[float | None, typer.Option(min=0.01, max=1000, callback=finite, help="Fuel capacity in largest "
                                               "distances.", show_default="the family's")] = None,
    tau: Annotated[float | None, typer.Option(min=0.01, max=1000, callback=finite, help="Mission limit in fuel "
                                              "capacities.", show_default="the family's")] = None,
    directed: Annotated[bool, typer.Option("--directed", help="Legs cost up to a tenth more, each way.")] = False,
    seed: Annotated[int, typer.Option(min=0, max=MOST_SEED, help="Seed of places and incentives.")] = 0,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Instance file to write; default: standard "
                                                "output.", show_default=False)] = None,
) -> None:
    """Make a random instance of the paper's kind."""
    with loading():
        from sva_bench.generate.instances import random_instance
        from sva_bench.mission.instance_file import instance_text

    write_result(output, instance_text(random_instance(
        family, pois=pois, vehicles=vehicles, availability=availability, fuel_multiple=fuel, tau=tau,
        directed=directed, seed=seed)))
