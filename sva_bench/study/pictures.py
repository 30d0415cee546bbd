"""Pictures of worlds with planned paths and routes, drawn by ``report.drawing``."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from sva_bench.files.printable import printable
from sva_bench.mission.plan import Plan
from sva_bench.report.drawing import draw_world
from sva_bench.report.overlays import Kind, Leg, Overlays
from sva_bench.report.stands import stands_of
from sva_bench.report.wording import listed
from sva_bench.study.costs import grounds_of, plan_costs
from sva_bench.study.planning import check_plans
from sva_bench.travel.fuel import FuelCosts
from sva_bench.travel.roadmap import roadmap_edges
from sva_bench.workers.progress import OnProgress
from sva_bench.world.model import World

_MOST_LETTERS = 40  # of a file's name

def picture_of(
    world: World, kind: Kind, *, roadmap: bool, paths: bool, progress: OnProgress,
    plan: Plan | None = None, plan_file: Path | None = None,
) -> bytes:
    """A picture of a world, with roadmap, paths and routes on request.

    Args:
        world: The world.
        kind: ``png`` or ``svg``.
        roadmap: Whether to show it; that of the widest robot where not all have the same.
        paths: Whether to show them; those of all robots.
        progress: Progress callback.
        plan, plan_file: A plan whose routes to show, and its file; one that breaks fuel or limit is shown too, with a
            warning.

    Raises:
        InfeasiblePlan: If the plan can't be driven with any fuel.
        NoRoomForBerths, NoRoomForSlots: If robots that meet don't fit about the base, or about a station.
        UnreachableSite: If paths are needed, and a site can't be reached.
    """
    stands = stands_of(world)
    if not (roadmap or paths or plan):
        return draw_world(world, kind, Overlays(stands=stands))
    costs = plan_costs(world, "prmstar", progress)
    kind_of_widest, widest = max(((kind_of, cost.times) for kind_of, cost in costs.items()),
                                 key=lambda item: item[1].model.radius_m)
    edges = None
    if roadmap:
        ground = grounds_of(world)[kind_of_widest].world
        points = np.array([(site.x_m, site.y_m) for site in ground.sites])
        edges = roadmap_edges(ground.obstacles, points, widest.clearance_m)
    drawn = [path for cost in costs.values() for i, row in enumerate(cost.times.paths) for path in row[i + 1:]
             if path is not None] if paths else []
    several = len(costs) > 1
    routes: dict[str, list[Leg]] = {}
    if plan is not None and plan_file is not None:
        check_plans(world, costs, {"plan": plan}, {"plan": plan_file}, allow_infeasible=True)
        routes = routes_of(world, costs, plan)
        world = replace(world, name=_title(world, plan, plan_file))  # which is what stands above the picture
    return draw_world(world, kind, Overlays(
        roadmap=edges, roadmap_of=kind_of_widest if several else "", paths=tuple(drawn),
        paths_of=listed(list(costs)) if several else "", routes=routes, stands=stands))


def _title(world: World, plan: Plan, file: Path) -> str:
    """What a picture of a plan is called: a plan that doesn't say what it maximises goes by its file."""
    stem = printable(file.stem)[:_MOST_LETTERS].replace("$", r"\$")  # it would begin a formula
    promised = "" if plan.value is None else f", promised {round(plan.value, 2) + 0.0:g}"
    return f"{world.name}: {f'plan {stem}' if plan.objective is None else f'{plan.objective} plan'}{promised}"


def routes_of(world: World, costs: Mapping[str, FuelCosts], plan: Plan) -> dict[str, list[Leg]]:
    """The legs of each robot's route, along the chains of paths that they stand for."""
    routes = {}
    for robot in world.robots:
        cost = costs[world.kind_of(robot)]
        routes[robot.name] = [
            Leg(destination=end, path=np.concatenate([
                cost.times.path(a, b) for a, b in itertools.pairwise(cost.chain(start, end))]))
            for start, end in itertools.pairwise(plan.route(robot.name))]
    return routes
