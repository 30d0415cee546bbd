"""The content of a recording as arrays: obstacles, robots over time, series and log entries; independent of Rerun."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sva_bench.arrays import FloatArray, IntArray, frozen, frozen_int
from sva_bench.choices import SiteKind
from sva_bench.execution.outcome import Trace
from sva_bench.execution.team_trace import NewsHeard
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.recording.about import About, legend, results_table
from sva_bench.recording.colors import ROBOT_COLORS, SITE_COLORS, Color, pale
from sva_bench.recording.hulls import solids_of
from sva_bench.recording.log import LogEntry, events_of, log_of
from sva_bench.recording.meetings import (
    Floor,
    Gate,
    Touched,
    Waiting,
    floors_of,
    gates_of,
    touched_of,
    waiting_of,
)
from sva_bench.recording.reactions import LOST, Change, Forgone, Lane, Lost, changes_of, forgone_of, lanes_of, lost_of
from sva_bench.recording.standing import raised_by, ranks_of, standing
from sva_bench.recording.states import StateLane, speed_of, state_lanes_of
from sva_bench.robot.body import Solid
from sva_bench.robot.model import RobotModel
from sva_bench.world.model import World

_DASH_M, _GAP_M = 0.25, 0.2  # of planned paths
_TRAIL_STEP_S = 0.25  # a robot at 0.65 m/s is 0.16 m past the end of its trail then: less than its radius
_SLOPE_TOLERANCE = 1e-6  # slopes of a fuel line [s/s] nearer than this are rounding, not a corner
_WALL_M = 0.12  # shown thickness of the walls about the bounds
_VIEW_RAD = math.radians(55)  # vertical field of view of the viewer's camera
_SLANT_RAD = math.radians(62)  # of the line of sight, from the horizontal
_ASPECT = 1.55  # width to height of the 3D view in the layout
_MARGIN = 0.07  # of the view, left free at its edges
_SMALLEST = 0.45  # radius of a POI that is worth little, in those of the one that is worth most
_LEAST_S = 10.0  # lines go on so long at least: of a mission that ends as it begins, too, something is seen
_NAME_SHARE = 0.055  # height of a name, in that of the view


@dataclass(frozen=True, eq=False, kw_only=True)
class Marks:
    """The sites of one kind.

    Attributes:
        kind: Base, station or POI.
        names: Their names, length n.
        at_m: Where they are, shape (n, 2).
        time_s: When their colours change, ascending from 0; shape (m,).
        colors: Red, green, blue of each site from each of these times on, shape (m, n, 3).
        size: Factor on how large each is shown, by what it is worth to the robot that earns most there, shape (n,).
    """

    kind: SiteKind
    names: tuple[str, ...]
    at_m: FloatArray
    time_s: FloatArray
    colors: IntArray
    size: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "size", frozen(self.size, (len(self.names),)))
        object.__setattr__(self, "at_m", frozen(self.at_m, (len(self.names), 2)))
        object.__setattr__(self, "time_s", frozen(self.time_s, (None,)))
        object.__setattr__(self, "colors", frozen_int(self.colors, (len(self.time_s), len(self.names), 3)))


@dataclass(frozen=True, eq=False, kw_only=True)
class Series:
    """A number over time: ``value`` at ``time_s`` [s], both of shape (n,)."""

    time_s: FloatArray
    value: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "time_s", frozen(self.time_s, (None,)))
        object.__setattr__(self, "value", frozen(self.value, (len(self.time_s),)))


@dataclass(frozen=True, eq=False, kw_only=True)
class RobotView:
    """One robot over time.

    Attributes:
        name: Its name.
        radius_m: Radius of its hull.
        solids: Its shape.
        color: Its colour.
        time_s: Mission clock of the poses, shape (n,).
        pose: x, y [m], yaw [rad], shape (n, 3).
        disabled_s: When it stopped for good away from the base [s]; ``None`` = it didn't.
        planned: Dashes of the path that was planned, each two ends [m], shape (d, 2, 2).
        trail_s: When each piece of its trail is complete, shape (t,).
        trail: Pieces of the driven path, each two ends [m], shape (t, 2, 2).
        fuel: Fuel left [s of driving]; ``None`` = it has no limit.
        collected: Incentive collected, a step at each POI.
        speed: Speed over ground [m/s].
        rank: How many robots that begin where it does come before it.
        raised: How far its name is raised above where it usually is [m], so that it is seen above theirs.
        believed: x, y where it believes to be at each pose [m], shape (n, 2); none if it knows where it is.
    """

    name: str
    radius_m: float
    solids: tuple[Solid, ...]
    color: Color
    time_s: FloatArray
    pose: FloatArray
    disabled_s: float | None
    planned: FloatArray
    trail_s: FloatArray
    trail: FloatArray
    fuel: Series | None
    collected: Series
    speed: Series
    rank: int
    raised: Series
    believed: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))

    def __post_init__(self) -> None:
        object.__setattr__(self, "planned", frozen(self.planned, (None, 2, 2)))
        object.__setattr__(self, "trail_s", frozen(self.trail_s, (None,)))
        object.__setattr__(self, "trail", frozen(self.trail, (len(self.trail_s), 2, 2)))
        object.__setattr__(self, "believed", frozen(self.believed, (None, 2)))


@dataclass(frozen=True, eq=False, kw_only=True)
class Story:
    """The content of a recording.

    Attributes:
        title: What it is called.
        world: Name of the world.
        duration_s: Time at which the last robot's mission ends [s].
        solids: What stands in the world.
        marks: The sites, one entry per kind that occurs.
        views: The robots.
        lost: Those that didn't come home.
        forgone: POIs that these, and late ones, were to visit and nobody collected.
        changes: Those whose orders changed.
        lanes: What is known when, robot by robot; none if no news came.
        touched: What hulls touched, robot by robot; none of robots that touched nothing.
        waiting: Waits on the way.
        gates: Passages that may be shut.
        floors: Patches of floor that grip less, or more.
        total: Incentive collected by all robots together.
        log: What happened, in order of time.
        states: What each robot is doing when.
        properties: What the recording is of; nothing where that isn't said.
        text: The same for people.
        eye_m: Position of the camera, x, y, z [m].
        target_m: Point that the camera looks at, x, y, z [m].
    """

    title: str
    world: str
    duration_s: float
    solids: Obstacles
    marks: tuple[Marks, ...]
    views: tuple[RobotView, ...]
    lost: tuple[Lost, ...]
    forgone: tuple[Forgone, ...]
    changes: tuple[Change, ...]
    lanes: tuple[Lane, ...]
    touched: tuple[Touched, ...]
    waiting: tuple[Waiting, ...]
    gates: tuple[Gate, ...]
    floors: tuple[Floor, ...]
    total: Series
    log: tuple[LogEntry, ...]
    states: tuple[StateLane, ...]
    properties: Mapping[str, str | int | float]
    text: str
    eye_m: tuple[float, float, float]
    target_m: tuple[float, float, float]


def ground_of(world: World) -> tuple[Obstacles, tuple[Marks, ...]]:
    """What stands in a world, and its sites before anybody visits them."""
    return world.obstacles.walled(_WALL_M), _marks(world, (), {}, ())


def eye_of(world: World) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Camera position and target [m] from which the whole floor is seen."""
    return _eye(world.obstacles.bounds_m)


def story_of(
    world: World, traces: Sequence[Trace], title: str, news: Sequence[NewsHeard] = (), about: About | None = None,
    routes: Mapping[str, Sequence[str]] | None = None,
) -> Story:
    """The content of a recording of one trial.

    Args:
        world: The world.
        traces: One per robot at most, of one trial.
        title: What the recording is called.
        news: News of failures that the team heard, in order.
        about: What it is of; ``None`` = nobody says.
        routes: Stops of each robot as planned; ``None`` = those of the traces' orders.

    Raises:
        ValueError: If there is no trace, one without poses or of a robot that the world doesn't have, or two of
            one robot.
    """
    names = [trace.orders.robot for trace in traces]
    known = {robot.name: k for k, robot in enumerate(world.robots)}
    if not names or len(set(names)) < len(names) or not set(names) <= set(known):
        raise ValueError(f"expected one trace per robot out of {sorted(known)}, got {names}")
    if empty := [trace.orders.robot for trace in traces if not len(trace.time_s)]:
        raise ValueError(f"no poses of {empty}: a trace begins with the pose at the base")
    traces = sorted(traces, key=lambda trace: known[trace.orders.robot])
    colors = {name: ROBOT_COLORS[k % len(ROBOT_COLORS)] for name, k in known.items()}
    duration_s = max([*(heard.time_s for heard in news), *(max(float(trace.time_s[-1]), trace.outcome.end_time_s)
                                                           for trace in traces)])
    shown_s = max(duration_s, _LEAST_S)
    models = [world.robots[known[trace.orders.robot]].model for trace in traces]
    eye, target = _eye(world.obstacles.bounds_m)
    step_m = _NAME_SHARE * 2 * math.tan(_VIEW_RAD / 2) * math.dist(eye, target)
    views = _robot_views(traces, models, colors, shown_s, step_m)
    gains = [_gains(trace) for trace in traces]
    lost = tuple(lost_of(trace, view.radius_m) for trace, view in zip(traces, views, strict=True)
                 if view.disabled_s is not None)
    forgone, touched = forgone_of(world.pois, traces, colors, routes), touched_of(traces)
    changes = changes_of(news, colors)
    told = results_table(traces) if about is None else about.text(world.name, traces)
    marks = legend(changed=bool(changes), believed=any(len(view.believed) for view in views), lost=bool(lost),
                   forgone=bool(forgone), touched=bool(touched))
    return Story(
        title=title, world=world.name, duration_s=duration_s, solids=world.obstacles.walled(_WALL_M),
        marks=_marks(world, traces, colors, news), views=views, lost=lost,
        forgone=forgone, changes=changes,
        lanes=lanes_of(traces, news, colors), touched=touched, waiting=waiting_of(traces),
        gates=gates_of(world.passages, traces), floors=floors_of(world.obstacles.floors),
        total=_staircase(np.concatenate(gains), shown_s),
        log=log_of(traces, colors, news), states=state_lanes_of(traces),
        properties={} if about is None else about.properties(world.name, traces),
        text=f"{told}\n\n{marks}",
        eye_m=eye, target_m=target)


def dashes(path: FloatArray, dash_m: float, gap_m: float) -> FloatArray:
    """A polyline cut into dashes: the ends of each, straight from end to end.

    Args:
        path: Its corners [m], shape (k, 2).
        dash_m: Length of a dash.
        gap_m: Length of a gap.

    Returns:
        Ends of each dash, shape (d, 2, 2); a dash that turns a corner is two.
    """
    if len(path) < 2:
        return np.zeros((0, 2, 2))
    lengths = np.hypot(*np.diff(path, axis=0).T)
    arc = np.concatenate([[0.0], np.cumsum(lengths)])
    starts = np.arange(0.0, arc[-1], dash_m + gap_m)
    ends = np.minimum(starts + dash_m, arc[-1])
    # Cut at the corners too; a stretch between neighbouring cuts is drawn if it lies within a dash.
    cuts = np.unique(np.concatenate([starts, ends, arc]))
    middles = (cuts[:-1] + cuts[1:]) / 2
    drawn = middles % (dash_m + gap_m) < dash_m
    points = np.stack([np.interp(cuts, arc, path[:, 0]), np.interp(cuts, arc, path[:, 1])], axis=1)
    pieces: FloatArray = np.stack([points[:-1][drawn], points[1:][drawn]], axis=1)
    return pieces


def corners(time_s: FloatArray, value: FloatArray) -> NDArray[np.bool_]:
    """Which points of a line chart are needed to draw the same lines, shape (n,).

    Args:
        time_s: Ascending, shape (n,).
        value: Shape (n,).
    """
    kept = np.ones(len(time_s), dtype=np.bool_)
    steps = np.diff(time_s)
    slopes = np.divide(np.diff(value), steps, out=np.full(len(steps), np.inf), where=steps > 0)
    with np.errstate(invalid="ignore"):  # two jumps in a row: inf - inf is no corner to leave out
        kept[1:-1] = ~(np.abs(np.diff(slopes)) <= _SLOPE_TOLERANCE)
    return kept


def _marks(world: World, traces: Sequence[Trace], colors: dict[str, Color], news: Sequence[NewsHeard]
           ) -> tuple[Marks, ...]:
    """Sites by kind. A POI has the colour of the robot that collected it, and before a light one of who takes it over
    or, left to nobody again, its own."""
    collected = [(event.time_s, event.site, colors[trace.orders.robot], True)
                 for event, trace in events_of(traces) if event.kind == "collected"]
    orphans = [change for heard in news for robot in heard.rerouted for change in (
        *((heard.time_s, site, SITE_COLORS["poi"], False) for site in robot.dropped),
        *((heard.time_s, site, pale(colors[robot.robot]), False) for site in robot.taken))]
    # Of the same moment, what is dropped comes before what is taken over: by whomever, it has a new owner then.
    painted = sorted([*orphans, *collected], key=lambda p: (p[0], p[3], p[2] != SITE_COLORS["poi"]))
    worth = {site.name: max((robot.incentives.get(site.name, 0.0) for robot in world.robots), default=0.0)
             for site in world.pois}
    most = max(worth.values(), default=0.0)
    marks = []
    for kind in SITE_COLORS:
        mine = [site for site in world.sites if site.kind == kind]
        index = {site.name: k for k, site in enumerate(mine)}
        now = np.tile(np.array(SITE_COLORS[kind], dtype=np.int64), (len(mine), 1))
        times, rows = [0.0], [now.copy()]
        taken: set[str] = set()
        for time_s, site, color, for_good in painted:
            if site in index and site not in taken:  # who collects it first
                if for_good:
                    taken.add(site)
                now[index[site]] = color
                if times[-1] == time_s and len(times) > 1:
                    rows[-1] = now.copy()
                else:
                    times.append(time_s)
                    rows.append(now.copy())
        if mine:
            marks.append(Marks(kind=kind, names=tuple(index), at_m=np.array([[s.x_m, s.y_m] for s in mine]),
                               time_s=np.array(times), colors=np.array(rows), size=np.array([
                                   _size(worth[site.name], most) if kind == "poi" else 1.0 for site in mine])))
    return tuple(marks)


def _size(worth: float, most: float) -> float:
    """Factor on the radius of a POI: its area goes by what it is worth, down to one that is still seen."""
    return max(math.sqrt(worth / most), _SMALLEST) if most > 0 else 1.0


def _robot_views(traces: Sequence[Trace], models: Sequence[RobotModel], colors: Mapping[str, Color], duration_s: float,
                 step_m: float) -> tuple[RobotView, ...]:
    """The robots; names of those that stand together are in rows, which are a step [m] high."""
    begins, lost = [trace.pose[0, :2] for trace in traces], [trace.outcome.end in LOST for trace in traces]
    ranks = ranks_of(begins, lost, min(model.radius_m for model in models))
    return tuple(_robot_view(trace, model, colors[trace.orders.robot], duration_s, rank, raised)
                 for trace, model, rank, raised in zip(traces, models, ranks, raised_by(begins, lost, step_m),
                                                       strict=True))


def _robot_view(trace: Trace, model: RobotModel, color: Color, duration_s: float, rank: int, raised_m: float
                ) -> RobotView:
    outcome, time, pose = trace.outcome, trace.time_s, trace.pose
    # The first pose at or after each step, and the last pose: the trail is as long as the drive.
    marks = np.searchsorted(time, np.arange(time[0], time[-1], _TRAIL_STEP_S))
    at = np.unique(np.append(marks, len(time) - 1))
    moved = np.any(pose[at[1:], :2] != pose[at[:-1], :2], axis=1)
    pieces = np.stack([pose[at[:-1], :2], pose[at[1:], :2]], axis=1)[moved]
    fuel = None
    if math.isfinite(trace.orders.fuel_capacity_s):
        when, left = time, trace.fuel_s
        if when[-1] < duration_s and outcome.end not in LOST:  # what a lost robot has left is nobody's
            when, left = np.append(when, duration_s), np.append(left, left[-1])
        kept = corners(when, left)
        fuel = Series(time_s=when[kept], value=left[kept])
    since_s, stands = standing(time, pose, 2 * model.radius_m)
    return RobotView(
        name=trace.orders.robot, radius_m=model.radius_m, solids=solids_of(model), color=color, time_s=time, pose=pose,
        disabled_s=outcome.end_time_s if outcome.end in LOST else None,
        planned=dashes(trace.planned, _DASH_M, _GAP_M), trail_s=time[at[1:]][moved], trail=pieces, fuel=fuel,
        collected=_staircase(_gains(trace), duration_s), speed=_speed(trace, duration_s), rank=rank,
        raised=Series(time_s=since_s, value=stands * raised_m), believed=trace.believed)


def _speed(trace: Trace, duration_s: float) -> Series:
    when, speed = speed_of(trace)
    if when[-1] < duration_s:
        when, speed = np.append(when, [min(when[-1] + 0.1, duration_s), duration_s]), np.append(speed, [0.0, 0.0])
    kept = corners(when, speed)
    return Series(time_s=when[kept], value=speed[kept])


def _gains(trace: Trace) -> FloatArray:
    """When the robot collected and what: time [s], incentive; shape (c, 2)."""
    gains = [[event.time_s, event.incentive] for event in trace.outcome.events if event.kind == "collected"]
    return np.array(gains, dtype=np.float64).reshape(-1, 2)


def _staircase(gains: FloatArray, duration_s: float) -> Series:
    """Running sum of gains from 0 s to the end of the mission."""
    gains = gains[np.argsort(gains[:, 0], kind="stable")]
    time, value = np.append(0.0, gains[:, 0]), np.append(0.0, np.cumsum(gains[:, 1]))
    if time[-1] < duration_s:
        time, value = np.append(time, duration_s), np.append(value, value[-1])
    return Series(time_s=time, value=value)


def _eye(bounds_m: FloatArray) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Camera position and target [m], from the south and above, so that the floor fills the view."""
    x0, y0, x1, y1 = bounds_m.tolist()
    back = np.array([0.0, -math.cos(_SLANT_RAD), math.sin(_SLANT_RAD)])
    up = np.array([0.0, math.sin(_SLANT_RAD), math.cos(_SLANT_RAD)])
    middle = np.array([(x0 + x1) / 2, (y0 + y1) / 2, 0.0])
    half_x, half_y = (x1 - x0) / 2, (y1 - y0) / 2
    top, nearness = half_y * up[1], half_y * -back[1]  # the north edge: height in view, farness
    tall = math.tan(_VIEW_RAD / 2) * (1 - _MARGIN)
    # The camera at the distance d, moved by s in its picture plane, sees the north edge at (top - s) / (d + nearness)
    # and the south edge at (-top - s) / (d - nearness); the south edge is the wider one.
    distance = max(top / tall, half_x / (tall * _ASPECT) + nearness)
    shift = -top * nearness / distance  # as much room above as below
    eye = middle + back * distance + up * shift
    target = eye - back * (eye[2] / back[2])  # on the floor, so that the view turns about a point of it
    return (float(eye[0]), float(eye[1]), float(eye[2])), (float(target[0]), float(target[1]), float(target[2]))
