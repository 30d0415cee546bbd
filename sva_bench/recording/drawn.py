"""What is seen on the map: floor and walls, sites, robots, their paths, and what became of them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sva_bench.arrays import FloatArray
from sva_bench.choices import SolidKind
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.recording.colors import ALARM, DISABLED, GREEN, ORANGE, Color, pale
from sva_bench.recording.hulls import half_of, quaternion_of, top_m
from sva_bench.recording.meetings import Floor, Gate, Touched, Waiting
from sva_bench.recording.reactions import Change, Forgone, Lost
from sva_bench.recording.rerun import Pen
from sva_bench.recording.story import Marks, RobotView, Story, dashes

_FLOOR: Color = (232, 232, 232)
_WALLS: Color = (176, 176, 176)
_HEADING: Color = (255, 255, 255)

_OBSTACLE_M = 0.35  # shown height: low, so that little is hidden behind it
_FLOOR_M = 0.02  # shown thickness
_PLANNED_M, _DRIVEN_M = 0.015, 0.03  # heights of lines above the floor, and below the robots
_ORDERS_M, _LOST_M = 0.045, 0.6  # of changed orders above those, and of what marks a lost robot above all
_NEW_UI, _CROSS_UI, _MARK_UI = 3.5, 3.5, 6.0  # widths of new orders and crosses, and size of marks
_PATCH_M, _GATE_M, _RING_M = 0.01, 0.1, 0.02  # thickness of floors' plates, height of gates, and of rings above hulls
_BAR_M, _GATE_UI = 0.12, 4.0  # length of a gate's dashes and of their gaps, and width
_NAME_M = 0.75  # a robot's name is this far north of its hull; the names of sites are south of them
_FORGONE_M = 0.3  # half the width of crosses over POIs
_WIDEST = 1.35  # radius of the POI that is worth most, in half widths of a station
_WITHIN = 0.02  # by what share of its size a hull is smaller than one that comes before it in the same place


def write_map(pen: Pen, story: Story) -> None:
    """Write all that is seen on the map."""
    write_ground(pen, story.solids, story.marks)
    for robot in story.views:
        _write_robot(pen, robot)
    by_name = {robot.name: robot for robot in story.views}
    for lost in story.lost:
        _write_lost(pen, lost, by_name[lost.robot])
    for forgone in story.forgone:
        _write_forgone(pen, forgone)
    _write_floors(pen, story.floors)
    for gate in story.gates:
        _write_gate(pen, gate)
    for touched in story.touched:
        _write_touched(pen, touched)
    _write_waiting(pen, story.waiting)
    for change in story.changes:
        _write_change(pen, change)


def write_ground(pen: Pen, solids: Obstacles, sites: Sequence[Marks]) -> None:
    """Write floor, walls and sites."""
    _write_solids(pen, solids)
    for marks in sites:
        _write_marks(pen, marks, solids)


def write_drive(pen: Pen, entity: str, time_s: FloatArray, pose: FloatArray, radius_m: float, color: Color) -> None:
    """Write a robot as it drives, and the line that it leaves.

    Args:
        pen, entity: Where.
        time_s: When it is where, shape (n,).
        pose: x, y [m], yaw [rad], shape (n, 3).
        radius_m, color: Its radius and colour.
    """
    pen.move(f"{entity}/robot", time_s, _deep(pose[:, :2], 0.0), _about_z(pose[:, 2]))
    pen.solids(f"{entity}/robot/body", "cylinder", np.array([[0.0, 0.0, radius_m]]), np.full((1, 3), radius_m),
               colors=[color])
    pen.lines_at(f"{entity}/line", time_s[-1:], _deep(pose[None, :, :2], _DRIVEN_M))
    pen.lines(f"{entity}/line", colors=[color], width_ui=1.75)


def _deep(points: FloatArray, z_m: float) -> NDArray[np.float32]:
    """Points of the floor at a height: shape (..., 2) to (..., 3)."""
    return np.concatenate([points, np.full((*points.shape[:-1], 1), z_m)], axis=-1).astype(np.float32)


def _about_z(yaw_rad: FloatArray) -> NDArray[np.float32]:
    """Quaternions x, y, z, w of turns about the vertical, shape (n, 4)."""
    nought = np.zeros_like(yaw_rad)
    return np.stack([nought, nought, np.sin(yaw_rad / 2), np.cos(yaw_rad / 2)], axis=-1).astype(np.float32)


def _write_solids(pen: Pen, solids: Obstacles) -> None:
    low, high = solids.bounds_m[:2], solids.bounds_m[2:]
    pen.z_is_up("world")
    pen.solids("world/floor", "box", _deep((low + high)[None] / 2, -_FLOOR_M / 2),
               _deep((high - low)[None] / 2, _FLOOR_M / 2), colors=[_FLOOR])
    boxes, cylinders = solids.boxes, solids.cylinders
    pen.solids("world/boxes", "box", _deep(boxes[:, :2], _OBSTACLE_M / 2), _deep(boxes[:, 2:4], _OBSTACLE_M / 2),
               turned=_about_z(boxes[:, 4]), colors=[_WALLS])
    if len(cylinders):
        pen.solids("world/cylinders", "cylinder", _deep(cylinders[:, :2], _OBSTACLE_M / 2),
                   _deep(cylinders[:, [2, 2]], _OBSTACLE_M / 2), colors=[_WALLS])


def _write_marks(pen: Pen, marks: Marks, solids: Obstacles) -> None:
    """Sites as plates on the floor: POIs round, stations square, the base a square on its corner."""
    x0, y0, x1, y1 = solids.bounds_m.tolist()
    half, thick = max(0.3, max(x1 - x0, y1 - y0) / 60), 0.02  # large enough to be seen in a large world
    n = len(marks.names)
    entity = {"base": "world/base", "station": "world/stations", "poi": "world/pois"}[marks.kind]
    kind: SolidKind = "cylinder" if marks.kind == "poi" else "box"
    sizes = half * _WIDEST * marks.size if marks.kind == "poi" else np.full(n, half)
    turned = None if marks.kind == "poi" else _about_z(np.full(n, math.radians(45) if marks.kind == "base" else 0.0))
    pen.solids(entity, kind, _deep(marks.at_m, thick / 2), _deep(np.stack([sizes, sizes], axis=1), thick / 2),
               turned=turned)
    pen.repaint(entity, kind, marks.time_s, marks.colors.reshape(-1, 3).astype(np.uint8), [n] * len(marks.time_s))
    pen.names(f"{entity}/names", marks.names, _deep(marks.at_m - [0.0, half], 0.0))


def _write_robot(pen: Pen, robot: RobotView) -> None:
    here, r = f"world/robots/{robot.name}", robot.radius_m
    height = top_m(robot.solids)
    # Place and heading apart: the name goes where the robot goes, but stays north of it.
    pen.move(here, robot.time_s, _deep(robot.pose[:, :2], 0.0))
    pen.move(f"{here}/hull", robot.time_s, turned=_about_z(robot.pose[:, 2]))
    _write_name(pen, f"{here}/name", robot, np.array([0.0, r + _NAME_M, height]))
    if robot.rank:
        # Else of hulls in one place now this and now that one would be seen, in patches.
        pen.scale(f"{here}/hull/body", 1.0 - _WITHIN * min(robot.rank, 9))
    _write_hull(pen, f"{here}/hull/body", robot)
    # A white bar on top, from the centre to the front.
    pen.solids(f"{here}/hull/heading", "box", np.array([[r / 2, 0.0, height]]), np.array([[r / 2, r / 6, r / 10]]),
               colors=[_HEADING])
    if len(robot.planned):
        pen.lines(f"world/planned/{robot.name}", _deep(robot.planned, _PLANNED_M), colors=[pale(robot.color)],
                  width_ui=1.0)
    if len(robot.believed):
        # A ring where it believes to be: centimetres beside its hull.
        turns = np.linspace(0.0, 2 * math.pi, 25)
        ring, entity = r * np.stack([np.cos(turns), np.sin(turns)], axis=-1), f"world/believed/{robot.name}"
        pen.move(entity, robot.time_s, _deep(robot.believed, 0.0))
        pen.lines(f"{entity}/ring", [_deep(ring, height + _RING_M)], colors=[pale(robot.color)], width_ui=1.25)
    if len(robot.trail):
        entity = f"world/driven/{robot.name}"
        pen.lines(entity, colors=[robot.color], width_ui=1.75)
        pen.lines_at(entity, robot.trail_s, _deep(robot.trail, _DRIVEN_M))


def _write_name(pen: Pen, entity: str, robot: RobotView, at_m: FloatArray) -> None:
    """The name of a robot above its hull, raised where others stand in the same place; gone once it is lost."""
    raised, gone_s = robot.raised, robot.disabled_s
    shown = raised.time_s < (math.inf if gone_s is None else gone_s)
    places = (at_m + np.outer(raised.value[shown], [0.0, 1.0, 0.0])).astype(np.float32)
    pen.names(entity, [robot.name])
    pen.points_at(entity, [*raised.time_s[shown], *([] if gone_s is None else [gone_s])], places,
                  counts=[1] * len(places) + [0] * (gone_s is not None))


def _write_hull(pen: Pen, entity: str, robot: RobotView) -> None:
    """The shape of a robot, dark once it is lost: an entity, or one for each kind of solid that its own body has."""
    times, colors = [0.0], [robot.color]
    if robot.disabled_s == 0:
        colors = [DISABLED]
    elif robot.disabled_s is not None:
        times, colors = [0.0, robot.disabled_s], [robot.color, DISABLED]
    kinds = dict.fromkeys(solid.kind for solid in robot.solids)
    for kind in kinds:
        mine = [solid for solid in robot.solids if solid.kind == kind]
        below = entity if len(robot.solids) == 1 else f"{entity}/{kind}"
        pen.solids(below, kind, np.array([solid.at_m for solid in mine]), np.array([half_of(solid) for solid in mine]),
                   turned=np.array([quaternion_of(solid) for solid in mine]))
        pen.repaint(below, kind, times, colors)


def _write_forgone(pen: Pen, forgone: Forgone) -> None:
    """Crosses in a robot's colour over the POIs that it left and nobody collected, from when on that is so."""
    entity, r = f"world/forgone/{forgone.robot}", _FORGONE_M
    cross = np.array([[[-r, -r], [r, r]], [[-r, r], [r, -r]]])
    strips = (forgone.at_m[:, None, None] + cross).reshape(-1, 2, 2)
    pen.lines_at(entity, [forgone.time_s], _deep(strips, _ORDERS_M), colors=[forgone.color] * len(strips),
                 counts=[len(strips)])
    pen.lines(entity, width_ui=_NEW_UI)


def _write_lost(pen: Pen, lost: Lost, robot: RobotView) -> None:
    """A red cross where a robot was lost, from then on, larger than it, and what happened, in the place of its name."""
    entity, r = f"world/lost/{lost.robot}", 2.2 * lost.radius_m
    cross = np.array([[[-r, -r], [r, r]], [[-r, r], [r, -r]]]) + lost.at_m
    pen.lines_at(entity, [lost.time_s], _deep(cross, _LOST_M), colors=[ALARM] * 2, counts=[2])
    pen.lines(entity, width_ui=_CROSS_UI)
    at = lost.at_m + np.array([0.0, robot.radius_m + _NAME_M + float(robot.raised.value[-1])])
    pen.points_at(f"{entity}/what", [lost.time_s], _deep(at[None], _LOST_M), names=[lost.what])
    pen.names(f"{entity}/what")


def _write_floors(pen: Pen, floors: Sequence[Floor]) -> None:
    """Patches of floor as plates, each with its friction."""
    if floors:
        boxes = np.array([floor.box for floor in floors])
        pen.solids("world/floors", "box", _deep(boxes[:, :2], _PATCH_M / 2), _deep(boxes[:, 2:4], _PATCH_M / 2),
                   turned=_about_z(boxes[:, 4]), colors=[floor.color for floor in floors])
        pen.names("world/floors/names", [f"friction {floor.friction:g}" for floor in floors],
                  _deep(boxes[:, :2], 0.0))


def _write_gate(pen: Pen, gate: Gate) -> None:
    """A dashed line across a passage: red while a robot waits before it, green else."""
    entity = f"world/passages/{gate.name}"
    pieces = dashes(gate.ends_m, _BAR_M, _BAR_M)
    pen.lines(entity, _deep(pieces, _GATE_M), width_ui=_GATE_UI)
    colors = [list(ALARM if shut else GREEN) for shut in gate.shut for _ in pieces]
    pen.lines_at(entity, gate.time_s, colors=np.array(colors, dtype=np.uint8),
                 counts=[len(pieces)] * len(gate.shut))
    pen.names(f"{entity}/name", [gate.name], _deep(gate.ends_m[1:], _GATE_M))


def _write_touched(pen: Pen, touched: Touched) -> None:
    """Red marks where a hull touched something, each from then on, and what it was."""
    entity = f"world/contacts/{touched.robot}"
    pen.points_at(entity, touched.time_s, _deep(touched.at_m, _LOST_M))
    pen.points(entity, colors=[ALARM], size_ui=_MARK_UI)
    named = [k for k, what in enumerate(touched.what) if what]
    pen.points_at(f"{entity}/what", touched.time_s[named], _deep(touched.at_m[named], _LOST_M),
                  names=[touched.what[k] for k in named])
    pen.names(f"{entity}/what")


def _write_waiting(pen: Pen, waiting: Sequence[Waiting]) -> None:
    """What a robot waits for, and how long, above it as long as it does."""
    for robot in dict.fromkeys(wait.robot for wait in waiting):
        mine, entity = [wait for wait in waiting if wait.robot == robot], f"world/waits/{robot}"
        times = [time for wait in mine for time in (wait.since_s, wait.until_s)]
        at, counts = _deep(np.array([wait.at_m for wait in mine]), _LOST_M), [1, 0] * len(mine)
        pen.points_at(entity, times, at, colors=[ORANGE] * len(mine), counts=counts)
        pen.points(entity, size_ui=_MARK_UI)
        pen.points_at(f"{entity}/what", times, at, counts=counts, names=[
            f"waits {wait.until_s - wait.since_s:.0f} s for {wait.what}" for wait in mine])
        pen.names(f"{entity}/what")


def _write_change(pen: Pen, change: Change) -> None:
    """A robot's orders from the moment on at which they change: what was left of them thin, what is left now thick."""
    for name, paths, color, width in (("old", change.old, pale(change.color), 1.0),
                                      ("new", change.new, change.color, _NEW_UI)):
        entity = f"world/orders/{change.robot}/{name}"
        pen.lines(entity, colors=[color], width_ui=width)
        lines = [path for path in paths if len(path) > 1]
        # No line is one too: it takes an earlier one away.
        strips = [_deep(path, _ORDERS_M) if len(path) > 1 else np.zeros((1, 3), dtype=np.float32) for path in paths]
        if lines:
            pen.lines_at(entity, change.time_s, strips)
