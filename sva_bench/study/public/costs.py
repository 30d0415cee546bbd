"""What driving costs in a world, and the instances made of that."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import nullcontext

from sva_bench.choices import PathPlanner
from sva_bench.errors import BadInput
from sva_bench.files.outputs import check_output, write_result
from sva_bench.mission.instance import Instance
from sva_bench.mission.instance_file import instance_text
from sva_bench.study.costs import grounds_of, instance_of, nominal_scenario, plan_costs, plan_times
from sva_bench.study.inputs import about
from sva_bench.study.public.arguments import (
    PathLike,
    WorldLike,
    by_model,
    called_from_python,
    choice,
    is_a,
    path_of,
    progress_of,
    refuse_other_world,
    world_given,
)
from sva_bench.travel.fuel import FuelCosts
from sva_bench.travel.fuel import fuel_costs as repaired
from sva_bench.travel.times import TravelTimes
from sva_bench.workers.progress import OnProgress


@called_from_python()
def travel_times(
    world: WorldLike, *, planner: PathPlanner = "prmstar", progress: OnProgress | None = None,
) -> dict[str, TravelTimes]:
    """Plan a path between each pair of sites and time it by the kinematic twin.

    Args:
        world: The world, or its file.
        planner: OMPL planner of the paths.
        progress: Called with what is being done, how much of it is done, and how much there is.

    Returns:
        By the name of the robot model, or of the robot where robots meet: times [ms], shape (n, n) for n sites,
        directed, and the paths [m] behind them.

    Raises:
        UnreachableSite: If a robot cannot get from the base to a site of a ``World``; of its file, ``BadFile`` says so
            with the line.
        NeverArrives: If the figures of a robot don't let it follow a path.
        NoRoomForBerths, NoRoomForSlots: If robots that meet don't fit about base or station; of a file as above.
        BadFile, BadInput: If something is wrong with the file, or with a value.
        ValueError: If an argument is of a wrong type.

    Source:
        ``f'`` of section 5.2 of the paper.
    """
    read, path = world_given(world)
    with nullcontext() if path is None else about(path):
        return plan_times(read, choice("planner", planner, PathPlanner), progress_of(progress))


@called_from_python()
def fuel_costs(
    world: WorldLike, *, times: Mapping[str, TravelTimes] | None = None, margin: float | None = None,
    planner: PathPlanner = "prmstar", progress: OnProgress | None = None,
) -> dict[str, FuelCosts]:
    """Fuel costs that obey the triangle inequality: the metric repair of the travel times, and the margin on top.

    Args:
        world: The world, or its file.
        times: Its travel times, if they are planned already.
        margin: Costs are repaired times x (1 + margin), 0 to 1; by default the world's.
        planner, progress: As for ``travel_times``, where they are not given.

    Returns:
        By the name of the robot model, or of the robot where robots meet: costs [s of driving], shape (n, n) for n
        sites, and the chain of legs behind each.

    Raises:
        UnreachableSite: If a robot cannot get from the base to a site of a ``World``; of its file, ``BadFile`` says so
            with the line.
        NeverArrives: If the figures of a robot don't let it follow a path.
        NoRoomForBerths, NoRoomForSlots: If robots that meet don't fit about base or station; of a file as above.
        BadFile, BadInput: If something is wrong with the file, or with a value.
        ValueError: If an argument is of a wrong type.

    Source:
        Floyd (1962), Algorithm 97; section 5.2 of the paper.
    """
    read, path = world_given(world, margin=margin)
    choice("planner", planner, PathPlanner)
    if times is None:
        with nullcontext() if path is None else about(path):
            return plan_costs(read, planner, progress_of(progress))
    given = by_model("times", times, TravelTimes, read, "travel times")
    for kind, ground in grounds_of(read).items():
        refuse_other_world(f"times[{kind!r}]", given[kind], ground.world)
    return {kind: repaired(time, read.margin) for kind, time in given.items()}


@called_from_python()
def make_instance(
    world: WorldLike, *, scenario: str | None = None, costs: Mapping[str, FuelCosts] | None = None,
    margin: float | None = None, planner: PathPlanner = "prmstar", output: PathLike | None = None,
    progress: OnProgress | None = None,
) -> Instance:
    """The instance of one scenario: all that a solver needs, as arrays, and no world.

    Args:
        world: The world, or its file.
        scenario: The scenario; by default the availabilities under ``robots:``.
        costs: The world's fuel costs, if they are known already.
        margin, planner, progress: As for ``fuel_costs``, where they are not given.
        output: Instance file (JSON) to write, for other solvers.

    Raises:
        UnreachableSite: If a robot cannot get from the base to a site of a ``World``; of its file, ``BadFile`` says so
            with the line.
        NeverArrives: If the figures of a robot don't let it follow a path.
        NoRoomForBerths, NoRoomForSlots: If robots that meet don't fit about base or station; of a file as above.
        BadFile, BadInput: If something is wrong with the file, or with a value.
        ValueError: If an argument is of a wrong type.
    """
    if scenario is not None:
        is_a("scenario", scenario, str, "a name")
    read, path = world_given(world, scenario, margin)
    choice("planner", planner, PathPlanner)
    target = None if output is None else path_of("output", output)
    if target is not None:
        check_output(target, way_out="choose another with --output")
    if costs is None:
        with nullcontext() if path is None else about(path):
            known = plan_costs(read, planner, progress_of(progress))
    else:
        if margin is not None:
            raise BadInput("margin: the given costs have theirs already; leave out one of the two")
        known = by_model("costs", costs, FuelCosts, read, "fuel costs")
        for kind, ground in grounds_of(read).items():
            refuse_other_world(f"costs[{kind!r}]", known[kind].times, ground.world)
    instance = instance_of(read, known, read.scenarios[0] if scenario else nominal_scenario(read))
    if target is not None:
        write_result(target, instance_text(instance))
    return instance
