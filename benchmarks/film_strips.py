"""Film strips for docs/contact.md: a robot that runs dry, one that scrapes and sticks, one that waits at a shut door.

Each is one trial of ``examples/one-door.yaml``, found among many and driven again; frames show what its trace holds.

    python -m benchmarks.film_strips            # writes docs/pictures/*.png
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle

from sva_bench.execution.case import Case, Settings
from sva_bench.execution.execute import execute
from sva_bench.execution.executed import Executed
from sva_bench.execution.outcome import Event, Trace
from sva_bench.mission.plan import Plan
from sva_bench.report.ground import corners
from sva_bench.solver.two_stage import plan_stochastic
from sva_bench.study.costs import instance_of, plan_costs
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.load import load_world
from sva_bench.world.model import World

ROOT = Path(__file__).parents[1]
TRIALS = 128
BLUE, RED, GREEN, GREY, ORANGE = "#0072B2", "#D00000", "#0B6E4F", "#969696", "#E69F00"
LEAD_S = 6.0  # before what a strip is about
ZOOM_M = 0.75
MOST_TOUCHES = 3  # of a strip that is not about them
FAR_M = 3.0  # from home, so that one sees that it isn't there


@dataclass(frozen=True, eq=False, kw_only=True)
class Shot:
    """One frame: when [s], what is said below it, and whether it is seen from near."""

    time_s: float
    said: str
    near: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Strip:
    """A strip: its file, its title, and what makes shots of a trace, or says that it isn't of the kind."""

    name: str
    title: str
    shots: Callable[[Trace], list[Shot]]


def runs_dry(trace: Trace) -> list[Shot]:
    """From a full tank past a contact that cost time to an empty tank."""
    events = trace.outcome.events
    touches, end = told(events, "touches"), events[-1]
    if trace.outcome.end != "out_of_fuel" or not 1 <= len(touches) <= MOST_TOUCHES or math.dist(
            trace.pose[-1, :2], trace.pose[0, :2]) < FAR_M:
        return []
    touch, before = touches[0], touches[0].time_s - LEAD_S / 2
    after_s = touch.time_s + touch.lasts_s
    if end.time_s - max(t.time_s + t.lasts_s for t in touches) < LEAD_S / 3:  # held, rather than scraping
        return []
    return [
        Shot(time_s=0.0, said=f"{trace.orders.fuel_capacity_s:g} s of fuel, if the tank holds what it should"),
        Shot(time_s=before, said=passed(events, before)),
        Shot(time_s=after_s, said=f"scrapes along {touch.what} for {touch.lasts_s:.1f} s", near=True),
        Shot(time_s=(after_s + end.time_s) / 2, said=passed(events, (after_s + end.time_s) / 2)),
        Shot(time_s=end.time_s, said=f"out of fuel on the way to {end.site}")]


def scrapes(trace: Trace) -> list[Shot]:
    """From before the first contact of the end to where it gave up."""
    events = trace.outcome.events
    touches = told(events, "touches")
    if trace.outcome.end != "stuck" or not touches or touches[-1].time_s - touches[0].time_s < 0.5:
        return []
    first, last, end = touches[0], touches[-1], events[-1]
    return [
        Shot(time_s=first.time_s - LEAD_S, said=passed(events, first.time_s - LEAD_S)),
        Shot(time_s=first.time_s - 1, said="it believes to be where the ring is", near=True),
        Shot(time_s=first.time_s, said=f"its hull touches {first.what}", near=True),
        Shot(time_s=last.time_s + 1, said=f"it scrapes along, {len(touches)} contacts in all", near=True),
        Shot(time_s=end.time_s, said=f"stuck, held by {end.what}", near=True)]


def waits(trace: Trace) -> list[Shot]:
    """From before a shut door to its coming home late or not."""
    events = trace.outcome.events
    found = told(events, "waits")
    if len(found) < 1 or told(events, "touches") or trace.outcome.end != "late":
        return []
    wait = found[0]
    return [
        Shot(time_s=wait.time_s - LEAD_S / 2, said=passed(events, wait.time_s - LEAD_S / 2)),
        Shot(time_s=wait.time_s + 1, said=f"the {wait.what} is shut"),
        Shot(time_s=wait.time_s + wait.lasts_s - 1, said=f"it waits for {wait.lasts_s:g} s, which burn no fuel"),
        Shot(time_s=wait.time_s + wait.lasts_s + 3, said="on its way again"),
        Shot(time_s=trace.outcome.end_time_s, said=f"home late: the limit is {trace.orders.mission_limit_s:g} s")]


STRIPS = (Strip(name="runs-dry", shots=runs_dry,
                title="A robot that scrapes along a box, and runs dry just before the station"),
          Strip(name="scrapes", title="A robot that sticks at a door post", shots=scrapes),
          Strip(name="waits", title="A robot that waits at a shut door", shots=waits))


def told(events: Sequence[Event], kind: str) -> list[Event]:
    return [event for event in events if event.kind == kind]


def passed(events: Sequence[Event], time_s: float) -> str:
    """Where a robot is going, and what was last."""
    stops = [event for event in events if event.kind in ("departed", "collected", "refuelled") and
             event.time_s <= time_s]
    ahead = next((event.site for event in events if event.time_s > time_s and event.kind in (
        "arrived", "out_of_fuel", "stuck", "late")), "base")
    last = stops[-1] if stops else events[0]
    what = {"departed": "left", "collected": "collected", "refuelled": "refuelled at"}.get(last.kind, "left")
    return f"{what} {last.site}, on the way to {ahead}"


def one_trial(world: World, costs: dict[str, FuelCosts], plan: Plan, trial: int) -> Executed:
    settings = Settings(seed=0, trials=1, rollouts=TRIALS, fidelity="rollout", first=trial)
    (run,) = execute(world, costs, [Case(scenario=world.scenarios[0], planner="stochastic", plan=plan)], settings)
    return run


def main() -> None:
    world = load_world(ROOT / "examples" / "one-door.yaml")
    costs = dict(plan_costs(world, "prmstar", lambda *_: None))
    plan = plan_stochastic(instance_of(world, costs, world.scenarios[0]))
    missing = list(STRIPS)
    for trial in range(TRIALS):
        run = one_trial(world, costs, plan, trial)
        print(trial, [(trace.orders.robot, trace.outcome.end, [e.kind for e in trace.outcome.events if e.kind in (
            "waits", "touches")]) for trace in run.traces], flush=True)
        for strip in list(missing):
            for trace in run.traces:
                if strip in missing and (shots := strip.shots(trace)):
                    missing.remove(strip)
                    path = ROOT / "docs" / "pictures" / f"{strip.name}.png"
                    draw(path, world, trace, shots, f"{strip.title}: {trace.orders.robot}, trial {trial}")
                    print(path, [round(shot.time_s, 1) for shot in shots])
        if not missing:
            return
    raise SystemExit(f"not found in {TRIALS} trials: {[strip.name for strip in missing]}")


def draw(path: Path, world: World, trace: Trace, shots: Sequence[Shot], title: str) -> None:
    """Draw the frames side by side."""
    mpl.rcParams.update({"font.family": "DejaVu Sans", "font.size": 8})
    x0, y0, x1, y1 = world.obstacles.bounds_m.tolist()
    wide = 2.9
    tall = wide * (y1 - y0) / (x1 - x0)
    figure = Figure(figsize=(wide * len(shots) + 0.2, tall + 1.05), dpi=110, facecolor="white")
    FigureCanvasAgg(figure)
    figure.text(0.01, 0.985, title, fontsize=11, weight="bold", va="top")
    for number, shot in enumerate(shots):
        width = 1 / len(shots)
        axes = figure.add_axes((number * width + 0.006, 0.6 / (tall + 1.05), width - 0.012, tall / (tall + 1.05)))
        frame(axes, world, trace, shot)
        figure.text(number * width + 0.008, 0.5 / (tall + 1.05), f"{shot.time_s:.0f} s", fontsize=9, weight="bold",
                    va="top")
        figure.text(number * width + 0.008, 0.3 / (tall + 1.05), shot.said, va="top", fontsize=8)
    figure.savefig(path, metadata={"Software": None})


def frame(axes: Axes, world: World, trace: Trace, shot: Shot) -> None:
    x0, y0, x1, y1 = world.obstacles.bounds_m.tolist()
    axes.set_xticks([])
    axes.set_yticks([])
    axes.set_xlim(x0, x1)
    axes.set_ylim(y0, y1)
    for box in corners(world.obstacles.boxes):
        axes.add_patch(Polygon(box, facecolor=GREY, zorder=1))
    events = [event for event in trace.outcome.events if event.time_s <= shot.time_s + 1e-6]
    for passage in world.passages:
        shut = any(e.kind == "waits" and e.what == passage.name and shot.time_s < e.time_s + e.lasts_s for e in events)
        ax, ay, bx, by = passage.ends_m
        axes.plot([ax, bx], [ay, by], color=RED if shut else GREEN, linestyle="-" if shut else (0, (2, 1.5)),
                  linewidth=4 if shut else 2.5, zorder=3)
    axes.plot(*trace.planned.T, color=BLUE, linewidth=0.7, linestyle=(0, (3, 3)), alpha=0.6, zorder=2)
    done = trace.time_s <= shot.time_s + 1e-6
    axes.plot(*trace.pose[done, :2].T, color=BLUE, linewidth=1.8, zorder=4)
    collected = {event.site for event in events if event.kind == "collected"}
    for site in world.sites:
        marker, colour = {"base": ("s", "black"), "station": ("^", BLUE), "poi": ("o", ORANGE)}[site.kind]
        axes.plot(site.x_m, site.y_m, marker=marker, color=BLUE if site.name in collected else colour, markersize=6,
                  markeredgecolor="black", markeredgewidth=0.5, zorder=5)
        if not shot.near:
            axes.annotate(site.name, (site.x_m, site.y_m), xytext=(4, 3), textcoords="offset points", fontsize=7)
    radius = next(robot.model.radius_m for robot in world.robots if robot.name == trace.orders.robot)
    last = int(np.flatnonzero(done)[-1])
    x, y, yaw = trace.pose[last].tolist()
    lost = trace.outcome.end in ("out_of_fuel", "stuck") and shot.time_s >= trace.outcome.end_time_s - 1e-6
    axes.add_patch(Circle((x, y), radius, facecolor="#333333" if lost else BLUE, edgecolor="white", zorder=7))
    axes.plot([x, x + radius * math.cos(yaw)], [y, y + radius * math.sin(yaw)], color="white", linewidth=1.5, zorder=8)
    if len(trace.believed) and shot.near:
        axes.add_patch(Circle(tuple(trace.believed[last].tolist()), radius, facecolor="none", edgecolor=ORANGE,
                              linewidth=1.5, linestyle="--", zorder=9))
    met: list[Any] = [event.at_m for event in events if event.kind == "touches"]
    for px, py in met:
        axes.plot(px, py, marker="X", color=RED, markersize=8 if shot.near else 6, markeredgecolor="white", zorder=10)
    if lost:
        axes.plot(x, y, marker="x", color=RED, markersize=13, markeredgewidth=2.5, zorder=11)
    if shot.near:
        share = (x1 - x0) / (y1 - y0)
        axes.set_xlim(x - ZOOM_M * share, x + ZOOM_M * share)
        axes.set_ylim(y - ZOOM_M, y + ZOOM_M)
    gauge(axes, float(trace.fuel_s[last]) / trace.orders.fuel_capacity_s)


def gauge(axes: Axes, share: float) -> None:
    """What is left in the tank, of what it should hold."""
    share = min(max(share, 0.0), 1.0)
    for width, filling, edge in ((0.3, "white", "black"), (0.3 * share, RED if share < 0.15 else GREEN, "none")):
        axes.add_patch(Rectangle((0.7, -0.12), width, 0.06, transform=axes.transAxes, facecolor=filling, edgecolor=edge,
                                 linewidth=0.7, zorder=12, clip_on=False))
    axes.text(0.68, -0.09, "fuel", transform=axes.transAxes, ha="right", va="center", fontsize=8)


if __name__ == "__main__":
    main()
