"""Film strips for docs/shared-worlds.md: robots at a door, at a station, and about one that failed.

Each is one mission in physics; frames show what its traces hold.

    python -m benchmarks.shared_strips          # writes docs/pictures/shared-*.png
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

from sva_bench.execution.case import Case
from sva_bench.execution.orders import orders_of, planned_legs
from sva_bench.execution.outcome import Event, RobotFate, Trace
from sva_bench.execution.shared.execute import TeamTask, ground_of, play_missions
from sva_bench.execution.shared.own_ways import Ways
from sva_bench.execution.shared.players import MissionKey
from sva_bench.execution.shared.trace import traces_of
from sva_bench.files.documents import parse_yaml
from sva_bench.mission.plan import Plan
from sva_bench.report.ground import corners
from sva_bench.robot.disturbance import NO_WAVES
from sva_bench.study.costs import plan_costs
from sva_bench.world.load import world_of
from sva_bench.world.model import World

PICTURES = Path(__file__).parents[1] / "docs" / "pictures"
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")
GREY, RED = "#969696", "#D00000"
WIDE_M, DEEP_M = 10.0, 6.0
WIDE = 3.5  # of a frame [inch]
NEAR_M = 0.9  # of what a name might cover
TRAIL_S = 8.0  # of the way behind a robot that is drawn

Box = tuple[float, float, float, float]


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A mission to film.

    Attributes:
        name, title: Of the strip.
        boxes: Obstacles: middle and size [m].
        base, station, pois: Places [m].
        tours: Stops of each robot.
        shots: When [s], and what is said below.
        lifetime_s: Driving time after which a robot fails, by its number.
    """

    name: str
    title: str
    boxes: Sequence[Box]
    base: tuple[float, float]
    pois: Mapping[str, tuple[float, float]]
    tours: Sequence[Sequence[str]]
    shots: Sequence[tuple[float, str]]
    station: tuple[float, float] | None = None
    lifetime_s: Mapping[int, float] = field(default_factory=dict)


DOOR: Sequence[Box] = ((5, 1.3, 0.25, 2.6), (5, 4.7, 0.25, 2.6))
SCENES = (
    Scene(name="shared-door", title="Two robots meet at a door that is wide enough for one",
          boxes=DOOR, base=(1.5, 3), pois={"p1": (8.5, 4.6), "p3": (2.5, 5.4)},
          tours=(("p1",), ("p3", "p1")), shots=(
              (13, "uv1 is at p1 soon; uv2 comes from p3"), (18, "uv2 waits where uv1 can get by"),
              (23, "uv1 comes out of the door"), (28, "and uv2 goes in"))),
    Scene(name="shared-queue", title="Three robots queue at a station with one slot",
          boxes=((5, 5.2, 0.25, 1.6), (5, 0.8, 0.25, 1.6)), base=(1.5, 3), station=(8.6, 3),
          pois={"p1": (7.0, 5.2), "p2": (7.0, 0.8), "p3": (3.5, 1.0)},
          tours=(("r1", "p1"), ("r1", "p2"), ("p3", "r1")), shots=(
              (12, "uv2 is to be the first"), (25, "uv1 and uv3 wait where uv2 gets out"),
              (34, "uv1 is charged, uv3 moved up"), (48, "uv3 is charged, the others are off"))),
    Scene(name="shared-detour", title="A robot fails in the passage that another was to take",
          boxes=((5, 0.6, 3.0, 1.2), (5, 3.3, 3.0, 1.8), (5, 5.6, 3.0, 0.8)), base=(1.5, 3), pois={
              "p1": (8.5, 2.2), "p2": (8.5, 0.8)},
          tours=(("p1",), ("p2",)), shots=(
              (4, "both take the wider passage"), (6, "uv2 fails in it, and uv1 brakes"),
              (13, "uv1 has a new way, by the other one"), (30, "and comes home by it, too")), lifetime_s={1: 5.4}))


def filmed(scene: Scene) -> tuple[World, tuple[Trace, ...]]:
    """A scene's world, and the traces of its robots."""
    document = {
        "format": "sva-bench/world@1", "name": scene.name, "interaction": "shared",
        "map": {"shapes": {"bounds_m": [0, 0, WIDE_M, DEEP_M], "obstacles": [
            {"box": [x, y], "size_m": [wide, deep]} for x, y, wide, deep in scene.boxes]}},
        "sites": {"base": {"at_m": list(scene.base)},
                  "stations": {} if scene.station is None else {"r1": {"at_m": list(scene.station), "stop_s": 10}},
                  "pois": {name: {"at_m": list(place), "stop_s": 2} for name, place in scene.pois.items()}},
        "robots": {f"uv{k + 1}": {"model": "turtlebot2", "availability": 0.9, "mission_limit_s": 600,
                                  "fuel_capacity_s": 300, "incentives": dict.fromkeys(scene.pois, 10)}
                   for k in range(len(scene.tours))}}
    world = world_of(parse_yaml(json.dumps(document), Path(f"{scene.name}.yaml")))
    costs = plan_costs(world, "prmstar", lambda *_: None)
    case = Case(scenario=world.scenarios[0], planner="by hand", plan=Plan(routes={
        f"uv{k + 1}": ("base", *tour, "base") for k, tour in enumerate(scene.tours)}))
    orders = tuple(orders_of(world, case, planned_legs(world, costs, [case])))
    fates = tuple(RobotFate(lifetime_s=scene.lifetime_s.get(k, math.inf)) for k in range(len(orders)))
    (mission,) = play_missions(TeamTask(
        world=world, ground=ground_of(world, costs), orders=orders, traced=(True,), seed=0, fidelity="physics",
        keys=(MissionKey(tuple(own.route for own in orders), fates, 0),)))
    return world, traces_of(Ways(world, costs), orders, mission, [NO_WAVES] * len(orders))


def draw(scene: Scene, world: World, traces: Sequence[Trace]) -> None:
    """Draw the frames side by side."""
    mpl.rcParams.update({"font.family": "DejaVu Sans", "font.size": 8})
    tall = WIDE * DEEP_M / WIDE_M
    high = tall + 0.85
    figure = Figure(figsize=(WIDE * len(scene.shots), high), dpi=110, facecolor="white")
    FigureCanvasAgg(figure)
    figure.text(0.006, 0.985, scene.title, fontsize=11, weight="bold", va="top")
    width = 1 / len(scene.shots)
    for number, (time_s, said) in enumerate(scene.shots):
        frame(figure.add_axes((number * width + 0.006, 0.5 / high, width - 0.012, tall / high)), world, traces, time_s)
        figure.text(number * width + 0.008, 0.43 / high, f"{time_s:.0f} s", fontsize=9, weight="bold", va="top")
        figure.text(number * width + 0.008, 0.22 / high, said, va="top", fontsize=8)
    figure.savefig(PICTURES / f"{scene.name}.png", metadata={"Software": None})


def frame(axes: Axes, world: World, traces: Sequence[Trace], time_s: float) -> None:
    axes.set_xticks([])
    axes.set_yticks([])
    axes.set_xlim(0, WIDE_M)
    axes.set_ylim(0, DEEP_M)
    for box in corners(world.obstacles.boxes):
        axes.add_patch(Polygon(box, facecolor=GREY, zorder=1))
    for site in world.sites[1:]:
        marker, colour = ("^", "#56B4E9") if site.kind == "station" else ("o", "#F0E442")
        axes.plot(site.x_m, site.y_m, marker=marker, color=colour, markersize=8, markeredgecolor="black",
                  markeredgewidth=0.6, zorder=3)
        axes.annotate(site.name, (site.x_m, site.y_m), xytext=(7, 5), textcoords="offset points", fontsize=8, zorder=3)
    now = [pose_at(trace, time_s) for trace in traces]
    for trace, robot, colour, (x, y, yaw) in zip(traces, world.robots, COLOURS, now, strict=False):
        behind = (trace.time_s <= time_s) & (trace.time_s >= time_s - TRAIL_S)
        axes.plot([*trace.pose[behind, 0], x], [*trace.pose[behind, 1], y], color=colour, linewidth=2, zorder=4)
        ahead = (trace.time_s > time_s) & (trace.time_s <= time_s + TRAIL_S)
        axes.plot([x, *trace.pose[ahead, 0]], [y, *trace.pose[ahead, 1]], color=colour, linewidth=1,
                  linestyle=(0, (2, 2)), zorder=4)
        radius = robot.model.radius_m
        axes.add_patch(Circle(tuple(trace.pose[0, :2]), radius, facecolor="none", edgecolor=colour, linewidth=0.8,
                              linestyle=(0, (2, 2)), zorder=2))
        failed = trace.outcome.end == "failed" and time_s >= trace.outcome.end_time_s
        axes.add_patch(Circle((x, y), radius, facecolor="#444444" if failed else colour, edgecolor="white", zorder=6))
        axes.plot([x, x + radius * math.cos(yaw)], [y, y + radius * math.sin(yaw)], color="white", linewidth=1.5,
                  zorder=7)
        if failed:
            axes.plot(x, y, marker="x", color=RED, markersize=11, markeredgewidth=2.5, zorder=8)
        said, wait = robot.name, waiting(trace.outcome.events, time_s)
        if wait is not None:
            axes.add_patch(Circle((x, y), radius + 0.12, facecolor="none", edgecolor=RED, linewidth=1.8, zorder=7))
            said += " brakes" if wait.what == "replanning" else f" waits for {wait.what}"
        others = [(site.x_m, site.y_m) for site in world.sites[1:]]
        others += [(px, py) for px, py, _ in now if (px, py) != (x, y)]
        above = not any(0 <= py - y < NEAR_M and abs(px - x) < 2 * NEAR_M for px, py in others)
        side = "left" if x < NEAR_M else "right" if x > WIDE_M - 2 * NEAR_M else "center"
        axes.annotate(said, (x, y), xytext=(0, 11 if above else -17), textcoords="offset points", ha=side, fontsize=8,
                      weight="bold", color="#333333" if failed else colour, zorder=9,
                      bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.8})


def pose_at(trace: Trace, time_s: float) -> tuple[float, float, float]:
    """Where a robot is at a time."""
    x, y, yaw = (float(np.interp(time_s, trace.time_s, values)) for values in (
        trace.pose[:, 0], trace.pose[:, 1], np.unwrap(trace.pose[:, 2])))
    return x, y, yaw


def waiting(events: Sequence[Event], time_s: float) -> Event | None:
    """What a robot waits for at a time."""
    return next((e for e in events if e.kind == "waits" and e.time_s <= time_s <= e.time_s + e.lasts_s), None)


def main() -> None:
    for scene in SCENES:
        world, traces = filmed(scene)
        for trace in traces:
            print(scene.name, trace.orders.robot, trace.outcome.end, [
                (round(e.time_s, 1), e.kind, e.site, e.what, round(e.lasts_s, 1)) for e in trace.outcome.events])
        draw(scene, world, traces)


if __name__ == "__main__":
    main()
