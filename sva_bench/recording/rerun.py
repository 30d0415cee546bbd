"""Stories written as Rerun recordings, and screenshots by the viewer. The only importer of rerun."""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray
from rerun.chunk import RrdReader
from rerun.experimental import ViewerClient

from sva_bench.arrays import FloatArray
from sva_bench.execution.outcome import Trace
from sva_bench.execution.team_trace import NewsHeard
from sva_bench.files.atomic import by_way_of
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.recording.colors import ALARM, DISABLED, GREEN, ORANGE, Color, pale
from sva_bench.recording.meetings import Floor, Gate, Touched, Waiting
from sva_bench.recording.reactions import Change, Lost
from sva_bench.recording.story import Marks, RobotView, Series, Story, dashes, story_of
from sva_bench.world.model import World

TIMELINE = "sim_time"

_FLOOR: Color = (232, 232, 232)
_WALLS: Color = (176, 176, 176)
_BACKGROUND: Color = (28, 30, 34)  # as dark as the viewer's other panels
_NAMES: Color = (255, 255, 255)  # the viewer writes them on dark shields
_TOTAL: Color = (190, 190, 190)

_OBSTACLE_M = 0.35  # shown height: low, so that little is hidden behind it
_FLOOR_M = 0.02  # shown thickness
_PLANNED_M, _DRIVEN_M = 0.015, 0.03  # heights of lines above the floor, and below the robots
_ORDERS_M, _LOST_M = 0.045, 0.6  # of changed orders above those, and of what marks a lost robot above all
_NEW_UI, _CROSS_UI, _MARK_UI = 3.5, 3.5, 6.0  # widths of new orders and crosses, and size of marks
_PATCH_M, _GATE_M, _RING_M = 0.01, 0.1, 0.02  # thickness of floors' plates, height of gates, and of rings above hulls
_BAR_M, _GATE_UI = 0.12, 4.0  # length of a gate's dashes and of their gaps, and width
_NAME_M = 0.75  # a robot's name is this far north of its hull; the names of sites are south of them
_SETTLE_S, _SETTLE_TRIES = 0.5, 40  # between pictures; a third or fourth one is the last, on a slow machine a tenth
_PLAY_S = 30.0  # a mission is played in about this time


def record(path: Path, world: World, traces: Sequence[Trace], *, title: str, news: Sequence[NewsHeard] = ()) -> None:
    """Write one trial as a recording, with the layout that it is shown in.

    Args:
        path: The ``.rrd`` file; its folder exists. It appears under this name when it is complete.
        world: The world.
        traces: One per robot at most, of one trial.
        title: What the viewer calls the recording.
        news: News of failures that the team heard, and what it made of it.

    Raises:
        ValueError: If the traces don't belong to the world.
    """
    story = story_of(world, traces, title, news)
    # Layouts are kept per application id, and one layout fits one world. The recording's id follows from its content:
    # the same trial is the same recording, and two that are opened together stay apart.
    recording = rr.RecordingStream(f"sva-bench {world.name}", recording_id=_identity(story), send_properties=False)
    try:
        recording.set_log_time_enabled(False)
        recording.set_log_tick_enabled(False)
        # In memory: on a full disk the library's writer thread would hang.
        memory = recording.memory_recording()
        recording.send_blueprint(_layout(story))  # made active: the viewer in a browser takes no default from a file
        recording.send_recording_name(title)
        _write_solids(recording, story.solids)
        for marks in story.marks:
            _write_marks(recording, marks, story.solids)
        for robot in story.views:
            _write_robot(recording, robot)
        for lost in story.lost:
            _write_lost(recording, lost)
        _write_floors(recording, story.floors)
        for gate in story.gates:
            _write_gate(recording, gate)
        for touched in story.touched:
            _write_touched(recording, touched)
        _write_waiting(recording, story.waiting)
        for change in story.changes:
            _write_change(recording, change)
        _write_lanes(recording, story)
        _write_numbers(recording, story)
        _write_log(recording, story)
        recording.flush()
        unfinished = path.with_name(f"{path.name}.tmp")
        with by_way_of(unfinished, path):
            unfinished.write_bytes(memory.drain_as_bytes())
    finally:
        recording.disconnect()


def end_s(path: Path) -> float:
    """Last moment of a recording [s]."""
    timed = (chunk.to_record_batch() for chunk in RrdReader(path).stream() if TIMELINE in chunk.timeline_names)
    return max((int(rows.column(TIMELINE).cast("int64").to_numpy().max()) for rows in timed), default=0) / 1e9


def photograph(port: int, path: Path, picture: Path, at_s: float) -> None:
    """Have the viewer that listens at a port of this machine open a recording and save what it shows.

    Raises:
        RuntimeError: If the viewer doesn't answer, or can't.
    """
    client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
    client.open(str(path.resolve()))
    client.set_time(TIMELINE, duration=at_s, play_state="paused")
    # Charts, columns and notices settle over some frames: done when a picture is like the one before.
    before = b""
    for _ in range(_SETTLE_TRIES):
        time.sleep(_SETTLE_S)
        client.save_screenshot(str(picture.resolve()))
        now = picture.read_bytes()
        if now == before:
            return
        before = now
    raise RuntimeError("its picture did not come to rest")


def _identity(story: Story) -> str:
    digest = hashlib.sha256(f"{story.world}\0{story.title}".encode())
    for robot in story.views:
        digest.update(robot.name.encode())
        digest.update(robot.time_s.tobytes() + robot.pose.tobytes())
    for sentence in story.log:
        digest.update(f"{sentence.time_s!r}{sentence.text}".encode())
    return digest.hexdigest()[:32]


def _times(time_s: Iterable[float] | FloatArray) -> rr.TimeColumn:
    # Rounded here: rerun cuts off, and 0.29 s would become 0.289999999 s.
    nanoseconds = np.round(np.asarray(time_s, dtype=np.float64) * 1e9).astype("timedelta64[ns]")
    return rr.TimeColumn(TIMELINE, duration=nanoseconds)


def _column(recording: rr.RecordingStream, entity: str, time_s: Iterable[float] | FloatArray, columns: Any) -> None:
    recording.send_columns(entity, [_times(time_s)], columns, strict=True)


def _constant(recording: rr.RecordingStream, entity: str, *shapes: Any) -> None:
    recording.log(entity, *shapes, static=True, strict=True)


def _deep(points: FloatArray, z_m: float) -> NDArray[np.float32]:
    """Points of the floor at a height: shape (..., 2) to (..., 3)."""
    return np.concatenate([points, np.full((*points.shape[:-1], 1), z_m)], axis=-1).astype(np.float32)


def _about_z(yaw_rad: FloatArray) -> NDArray[np.float32]:
    """Quaternions x, y, z, w of turns about the vertical, shape (n, 4)."""
    nought = np.zeros_like(yaw_rad)
    return np.stack([nought, nought, np.sin(yaw_rad / 2), np.cos(yaw_rad / 2)], axis=-1).astype(np.float32)


def _write_solids(recording: rr.RecordingStream, solids: Obstacles) -> None:
    x0, y0, x1, y1 = solids.bounds_m.tolist()
    _constant(recording, "world", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    _constant(recording, "world/floor", rr.Boxes3D(
        centers=[[(x0 + x1) / 2, (y0 + y1) / 2, -_FLOOR_M / 2]],
        half_sizes=[[(x1 - x0) / 2, (y1 - y0) / 2, _FLOOR_M / 2]], colors=[_FLOOR], fill_mode="solid"))
    boxes = solids.boxes
    _constant(recording, "world/boxes", rr.Boxes3D(
        centers=_deep(boxes[:, :2], _OBSTACLE_M / 2),
        half_sizes=_deep(boxes[:, 2:4], _OBSTACLE_M / 2), quaternions=_about_z(boxes[:, 4]),
        colors=[_WALLS], fill_mode="solid"))
    if len(solids.cylinders):
        _constant(recording, "world/cylinders", rr.Cylinders3D(
            centers=_deep(solids.cylinders[:, :2], _OBSTACLE_M / 2), radii=solids.cylinders[:, 2],
            lengths=[_OBSTACLE_M] * len(solids.cylinders), colors=[_WALLS], fill_mode="solid"))


def _write_marks(recording: rr.RecordingStream, marks: Marks, solids: Obstacles) -> None:
    """Sites as plates on the floor: POIs round, stations square, the base a square on its corner."""
    x0, y0, x1, y1 = solids.bounds_m.tolist()
    half, thick = max(0.3, max(x1 - x0, y1 - y0) / 60), 0.02  # large enough to be seen in a large world
    n = len(marks.names)
    entity = {"base": "world/base", "station": "world/stations", "poi": "world/pois"}[marks.kind]
    centers = _deep(marks.at_m, thick / 2)
    if marks.kind == "poi":
        _constant(recording, entity, rr.Cylinders3D.from_fields(
            centers=centers, radii=[half] * n, lengths=[thick] * n, fill_mode="solid"))
        colors = rr.Cylinders3D.columns(colors=marks.colors.reshape(-1, 3).astype(np.uint8))
    else:
        turn = math.radians(45) if marks.kind == "base" else 0.0
        _constant(recording, entity, rr.Boxes3D.from_fields(
            centers=centers, half_sizes=[[half, half, thick / 2]] * n, quaternions=_about_z(np.full(n, turn)),
            fill_mode="solid"))
        colors = rr.Boxes3D.columns(colors=marks.colors.reshape(-1, 3).astype(np.uint8))
    _column(recording, entity, marks.time_s, colors.partition([n] * len(marks.time_s)))
    _write_names(recording, f"{entity}/names", marks.names, _deep(marks.at_m - [0.0, half], 0.0))


def _write_names(
    recording: rr.RecordingStream, entity: str, names: Sequence[str], at_m: NDArray[np.floating[Any]]
) -> None:
    """Names, each just below its point; labels of solids would have the solid's colour, and be hard to read."""
    _constant(recording, entity, rr.Points3D(
        at_m, radii=rr.Radius.ui_points(0.0), colors=[_NAMES], labels=names, show_labels=True))


def _write_robot(recording: rr.RecordingStream, robot: RobotView) -> None:
    here, r = f"world/robots/{robot.name}", robot.radius_m
    height = 2 * r
    # Place and heading apart: the name goes where the robot goes, but stays north of it.
    _column(recording, here, robot.time_s, rr.Transform3D.columns(translation=_deep(robot.pose[:, :2], 0.0)))
    _column(recording, f"{here}/hull", robot.time_s, rr.Transform3D.columns(quaternion=_about_z(robot.pose[:, 2])))
    _write_names(recording, f"{here}/name", [robot.name], np.array([[0.0, r + _NAME_M, height]]))
    _constant(recording, f"{here}/hull/body", rr.Cylinders3D.from_fields(
        centers=[[0, 0, height / 2]], radii=[r], lengths=[height], fill_mode="solid"))
    times, colors = [0.0], [robot.color]
    if robot.disabled_s == 0:
        colors = [DISABLED]
    elif robot.disabled_s is not None:
        times, colors = [0.0, robot.disabled_s], [robot.color, DISABLED]
    _column(recording, f"{here}/hull/body", times, rr.Cylinders3D.columns(colors=colors))
    # A white bar on top, from the centre to the front.
    _constant(recording, f"{here}/hull/heading", rr.Boxes3D(
        centers=[[r / 2, 0, height]], half_sizes=[[r / 2, r / 6, r / 10]], colors=[(255, 255, 255)], fill_mode="solid"))
    if len(robot.planned):
        _constant(recording, f"world/planned/{robot.name}", rr.LineStrips3D(
            _deep(robot.planned, _PLANNED_M), colors=[pale(robot.color)], radii=rr.Radius.ui_points(1.0)))
    if len(robot.believed):
        # A ring where it believes to be: centimetres beside its hull.
        turns = np.linspace(0.0, 2 * math.pi, 25)
        ring, entity = r * np.stack([np.cos(turns), np.sin(turns)], axis=-1), f"world/believed/{robot.name}"
        _column(recording, entity, robot.time_s, rr.Transform3D.columns(translation=_deep(robot.believed, 0.0)))
        _constant(recording, f"{entity}/ring", rr.LineStrips3D(
            [_deep(ring, height + _RING_M)], colors=[pale(robot.color)], radii=rr.Radius.ui_points(1.25)))
    if len(robot.trail):
        entity = f"world/driven/{robot.name}"
        _constant(recording, entity, rr.LineStrips3D.from_fields(
            colors=[robot.color], radii=rr.Radius.ui_points(1.75)))
        _column(recording, entity, robot.trail_s, rr.LineStrips3D.columns(strips=_deep(robot.trail, _DRIVEN_M)))


def _write_lost(recording: rr.RecordingStream, lost: Lost) -> None:
    """A red cross where a robot was lost, from then on, larger than the robot, and what happened."""
    entity, r = f"world/lost/{lost.robot}", 2.2 * lost.radius_m
    cross = np.array([[[-r, -r], [r, r]], [[-r, r], [r, -r]]]) + lost.at_m
    _column(recording, entity, [lost.time_s], rr.LineStrips3D.columns(
        strips=_deep(cross, _LOST_M), colors=[ALARM] * 2).partition([2]))
    _constant(recording, entity, rr.LineStrips3D.from_fields(radii=rr.Radius.ui_points(_CROSS_UI)))
    _column(recording, f"{entity}/what", [lost.time_s], rr.Points3D.columns(
        positions=_deep(lost.at_m[None] - [0.0, r + 0.2], _LOST_M), colors=[ALARM], labels=[lost.what]))
    _constant(recording, f"{entity}/what", rr.Points3D.from_fields(
        radii=rr.Radius.ui_points(0.0), show_labels=True))


def _write_floors(recording: rr.RecordingStream, floors: Sequence[Floor]) -> None:
    """Patches of floor as plates, each with its friction."""
    if floors:
        boxes = np.array([floor.box for floor in floors])
        _constant(recording, "world/floors", rr.Boxes3D(
            centers=_deep(boxes[:, :2], _PATCH_M / 2), half_sizes=_deep(boxes[:, 2:4], _PATCH_M / 2),
            quaternions=_about_z(boxes[:, 4]), colors=[floor.color for floor in floors], fill_mode="solid"))
        _write_names(recording, "world/floors/names", [f"friction {floor.friction:g}" for floor in floors],
                     _deep(boxes[:, :2], 0.0))


def _write_gate(recording: rr.RecordingStream, gate: Gate) -> None:
    """A dashed line across a passage: red while a robot waits before it, green else."""
    entity = f"world/passages/{gate.name}"
    pieces = dashes(gate.ends_m, _BAR_M, _BAR_M)
    _constant(recording, entity, rr.LineStrips3D.from_fields(
        strips=_deep(pieces, _GATE_M), radii=rr.Radius.ui_points(_GATE_UI)))
    colors = [list(ALARM if shut else GREEN) for shut in gate.shut for _ in pieces]
    _column(recording, entity, gate.time_s, rr.LineStrips3D.columns(
        colors=np.array(colors, dtype=np.uint8)).partition([len(pieces)] * len(gate.shut)))
    _write_names(recording, f"{entity}/name", [gate.name], _deep(gate.ends_m[1:], _GATE_M))


def _write_touched(recording: rr.RecordingStream, touched: Touched) -> None:
    """Red marks where a hull touched something, each from then on, and what it was."""
    entity = f"world/contacts/{touched.robot}"
    _column(recording, entity, touched.time_s, rr.Points3D.columns(positions=_deep(touched.at_m, _LOST_M)))
    _constant(recording, entity, rr.Points3D.from_fields(colors=[ALARM], radii=rr.Radius.ui_points(_MARK_UI)))
    named = [k for k, what in enumerate(touched.what) if what]
    _column(recording, f"{entity}/what", touched.time_s[named], rr.Points3D.columns(
        positions=_deep(touched.at_m[named], _LOST_M), labels=[touched.what[k] for k in named]))
    _constant(recording, f"{entity}/what", rr.Points3D.from_fields(
        colors=[ALARM], radii=rr.Radius.ui_points(0.0), show_labels=True))


def _write_waiting(recording: rr.RecordingStream, waiting: Sequence[Waiting]) -> None:
    """What a robot waits for, and how long, above it as long as it does."""
    for robot in dict.fromkeys(wait.robot for wait in waiting):
        mine, entity = [wait for wait in waiting if wait.robot == robot], f"world/waits/{robot}"
        times = [time for wait in mine for time in (wait.since_s, wait.until_s)]
        _column(recording, entity, times, rr.Points3D.columns(
            positions=_deep(np.array([wait.at_m for wait in mine]), _LOST_M), labels=[
                f"waits {wait.until_s - wait.since_s:.0f} s for {wait.what}" for wait in mine],
            colors=[ORANGE] * len(mine)).partition([1, 0] * len(mine)))
        _constant(recording, entity, rr.Points3D.from_fields(radii=rr.Radius.ui_points(_MARK_UI), show_labels=True))


def _write_change(recording: rr.RecordingStream, change: Change) -> None:
    """A robot's orders from the moment on at which they change: what was left of them thin, what is left now thick."""
    for name, paths, color, width in (("old", change.old, pale(change.color), 1.0),
                                      ("new", change.new, change.color, _NEW_UI)):
        entity = f"world/orders/{change.robot}/{name}"
        _constant(recording, entity, rr.LineStrips3D.from_fields(colors=[color], radii=rr.Radius.ui_points(width)))
        lines = [path for path in paths if len(path) > 1]
        # No line is one too: it takes an earlier one away.
        strips = [_deep(path, _ORDERS_M) if len(path) > 1 else np.zeros((1, 3), dtype=np.float32) for path in paths]
        if lines:
            _column(recording, entity, change.time_s, rr.LineStrips3D.columns(strips=strips))


def _write_lanes(recording: rr.RecordingStream, story: Story) -> None:
    """A lane for each robot: a cross where it was lost, and a mark each time that it learned of a failure."""
    for lane in story.lanes:
        for name, times, marker, color in (("lost", lane.lost_s, rr.components.MarkerShape.Cross, ALARM),
                                           ("learned", lane.learned_s, rr.components.MarkerShape.Diamond, lane.color)):
            if len(times):
                entity = f"news/{lane.robot}/{name}"
                _constant(recording, entity, rr.SeriesPoints(
                    names=f"{lane.robot} {name}", colors=[color], markers=marker, marker_sizes=_MARK_UI))
                _column(recording, entity, times, rr.Scalars.columns(scalars=[lane.height] * len(times)))


def _write_numbers(recording: rr.RecordingStream, story: Story) -> None:
    def line(entity: str, series: Series, name: str, color: Color, *, steps: bool, width: float = 2.0) -> None:
        _constant(recording, entity, rr.SeriesLines(
            names=name, colors=[color], widths=width, interpolation_mode="StepAfter" if steps else "Linear"))
        _column(recording, entity, series.time_s, rr.Scalars.columns(scalars=series.value))

    if len(story.views) > 1:
        line("collected/total", story.total, "all", _TOTAL, steps=True, width=3.0)
    for robot in story.views:
        line(f"collected/{robot.name}", robot.collected, robot.name, robot.color, steps=True)
        if robot.fuel is not None:
            line(f"fuel/{robot.name}", robot.fuel, robot.name, robot.color, steps=False)


def _write_log(recording: rr.RecordingStream, story: Story) -> None:
    if story.log:
        _column(recording, "events", [s.time_s for s in story.log], rr.TextLog.columns(
            text=[s.text for s in story.log], level=[s.level for s in story.log],
            color=[pale(s.color) for s in story.log]))


def _layout(story: Story) -> rrb.Blueprint:
    """The world at the left; fuel, incentive and log at the right."""
    whole_trail = rrb.VisibleTimeRanges(
        timeline=TIMELINE, start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.cursor_relative())
    space = rrb.Spatial3DView(
        origin="world", name=story.title, background=rrb.Background(kind="SolidColor", color=_BACKGROUND),
        line_grid=False, eye_controls=rrb.EyeControls3D(
            kind="Orbital", position=story.eye_m, look_target=story.target_m, eye_up=(0, 0, 1)),
        overrides=dict.fromkeys([
            *(f"world/driven/{robot.name}" for robot in story.views if len(robot.trail)),
            *(f"world/contacts/{touched.robot}{of}" for touched in story.touched for of in ("", "/what"))],
            whole_trail))
    axis = rrb.TimeAxis(view_range=rr.TimeRange(
        start=rr.TimeRangeBoundary.absolute(seconds=0.0),
        end=rr.TimeRangeBoundary.absolute(seconds=max(story.duration_s, 1.0))))
    most_fuel = max((float(robot.fuel.value.max()) for robot in story.views if robot.fuel is not None), default=0.0)
    right: list[rrb.View] = []
    shares = []
    if any(robot.fuel is not None for robot in story.views):
        right.append(rrb.TimeSeriesView(origin="fuel", name="Fuel left [s of driving]", axis_x=axis,
                                        axis_y=_from_zero(most_fuel), plot_legend=rrb.Corner2D.LeftBottom))
        shares.append(3)
    right.append(rrb.TimeSeriesView(origin="collected", name="Incentive collected", axis_x=axis,
                                    axis_y=_from_zero(float(story.total.value[-1])),
                                    plot_legend=rrb.Corner2D.LeftTop))
    shares.append(3)
    if story.lanes:
        right.append(rrb.TimeSeriesView(
            origin="news", name="Who was lost, and who learned of it when", axis_x=axis,
            axis_y=rrb.ScalarAxis(range=(-len(story.views) + 0.4, 0.6)), plot_legend=rrb.Corner2D.RightTop))
        shares.append(2)
    right.append(rrb.TextLogView(
        origin="events", name="Events", columns=rrb.TextLogColumns(
            timeline_columns=[TIMELINE], text_log_columns=["LogLevel", "Body"]),
        rows=rrb.TextLogRows(filter_by_log_level=["INFO", "WARN", "ERROR"])))
    return rrb.Blueprint(
        rrb.Horizontal(space, rrb.Vertical(*right, row_shares=[*shares, 4]), column_shares=[13, 7]),
        rrb.BlueprintPanel(state="collapsed"), rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="playing",
                      playback_speed=max(1.0, round(story.duration_s / _PLAY_S))),
        auto_layout=False, auto_views=False)


def _from_zero(most: float) -> rrb.ScalarAxis:
    """An axis from nought to ``most``, with a little room so that no line runs along the frame."""
    return rrb.ScalarAxis(range=(-0.03 * most, 1.06 * most) if most > 0 else (0.0, 1.0))
