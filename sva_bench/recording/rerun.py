"""Rerun's recordings: written with pens, laid out, read back, and photographed. The only importer of Rerun."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray
from rerun.chunk import RrdReader
from rerun.experimental import ViewerClient
from rerun_bindings import flush_and_cleanup_orphaned_recordings

from sva_bench.arrays import FloatArray
from sva_bench.choices import RobotState, SolidKind
from sva_bench.palette import Color
from sva_bench.recording.pictures import has_notice
from sva_bench.recording.views import (
    ChartView,
    Column,
    Layout,
    LogView,
    MapView,
    Panel,
    Row,
    StatesView,
    Tabs,
    TextView,
)

TIMELINE = "sim_time"
_NAMES: Color = (255, 255, 255)  # the viewer writes them on dark shields
_BACKGROUND: Color = (28, 30, 34)  # as dark as the viewer's other panels
_SETTLE_S, _SETTLE_TRIES = 0.5, 40  # between pictures; a third or fourth one is the last, on a slow machine a tenth
_NOTICE_TRIES = 16  # as often as it is looked whether a notice is gone: it lasts some seconds

Floats = NDArray[np.floating[Any]]
"""Numbers, of the shape that is said; a recording holds them with 32 bits."""
Colors = Sequence[Color] | NDArray[np.uint8]
"""Red, green and blue of each of n things, or of all of them: shape (n, 3) or (1, 3)."""
Times = Sequence[float] | FloatArray
"""Moments [s], shape (m,)."""

_SOLIDS: Mapping[SolidKind, Any] = {"box": rr.Boxes3D, "cylinder": rr.Cylinders3D, "sphere": rr.Ellipsoids3D}
_MARKERS = {"cross": rr.components.MarkerShape.Cross, "diamond": rr.components.MarkerShape.Diamond}
_CORNERS = {"left_top": rrb.Corner2D.LeftTop, "left_bottom": rrb.Corner2D.LeftBottom,
            "right_top": rrb.Corner2D.RightTop}


@dataclass(frozen=True, eq=False, kw_only=True)
class Pen:
    """What writes entities into a recording; ``entity`` is always a path from where the pen is.

    What is written without times is so all the time; what is written with m times is so from each to the next. Where
    n things are written at m times, ``counts`` says how many of them belong to each time, in turn: shape (m,), sum n;
    ``None`` = one to each.

    Attributes:
        stream: The recording.
        path: Where the pen is, with a slash at its end; nothing = at the root.
    """

    stream: rr.RecordingStream
    path: str = ""

    def below(self, path: str) -> Pen:
        """A pen that writes below a path from where this one is."""
        return replace(self, path=f"{self.path}{path}")

    def solids(self, entity: str, kind: SolidKind, at_m: Floats, half_m: Floats, *,
               turned: Floats | None = None, colors: Colors | None = None) -> None:
        """Write solids of one kind.

        Args:
            entity, kind: Its path, and what they are.
            at_m: Their centres, shape (n, 3).
            half_m: Half their extents along their own axes [m], shape (n, 3).
            turned: Their rotations as x, y, z, w, shape (n, 4); ``None`` = none.
            colors: Their colours; ``None`` = they are written by ``repaint``.
        """
        size = {"radii": half_m[:, 0], "lengths": 2 * half_m[:, 2]} if kind == "cylinder" else {"half_sizes": half_m}
        self._constant(entity, _SOLIDS[kind].from_fields(
            centers=at_m, quaternions=turned, colors=colors, fill_mode="solid", **size))

    def repaint(self, entity: str, kind: SolidKind, time_s: Times, colors: Colors, counts: Sequence[int] | None = None
                ) -> None:
        """Write colours of solids over time."""
        self._column(entity, time_s, _SOLIDS[kind].columns(colors=colors), counts)

    def move(self, entity: str, time_s: Times, at_m: Floats | None = None, turned: Floats | None = None) -> None:
        """Write where all below an entity is over time, seen from what is above it.

        Args:
            entity, time_s: Its path, and moments.
            at_m: Its place, shape (m, 3).
            turned: Its rotation as x, y, z, w, shape (m, 4).
        """
        self._column(entity, time_s, rr.Transform3D.columns(translation=at_m, quaternion=turned))

    def scale(self, entity: str, factor: float) -> None:
        """Show all below an entity larger, or smaller."""
        self._constant(entity, rr.Transform3D.from_fields(scale=[factor] * 3))

    def z_is_up(self, entity: str) -> None:
        """Say of all below an entity that z points upwards."""
        self._constant(entity, rr.ViewCoordinates.RIGHT_HAND_Z_UP)

    def lines(self, entity: str, strips: Sequence[Floats] | Floats | None = None, *, colors: Colors | None = None,
              width_ui: float) -> None:
        """Write lines, or how they look that ``lines_at`` writes.

        Args:
            entity: Its path.
            strips: Corners of each, n arrays of shape (k, 3).
            colors: Their colours.
            width_ui: Half their width, in points of the screen.
        """
        self._constant(entity, rr.LineStrips3D.from_fields(
            strips=strips, colors=colors, radii=rr.Radius.ui_points(width_ui)))

    def lines_at(self, entity: str, time_s: Times, strips: Sequence[Floats] | Floats | None = None, *,
                 colors: Colors | None = None, counts: Sequence[int] | None = None) -> None:
        """Write lines over time, or their colours alone: n arrays of corners, of shape (k, 3)."""
        self._column(entity, time_s, rr.LineStrips3D.columns(strips=strips, colors=colors), counts)

    def points(self, entity: str, *, colors: Colors | None = None, size_ui: float) -> None:
        """Write how points look that ``points_at`` writes: their colours, and radius in points of the screen."""
        self._constant(entity, rr.Points3D.from_fields(colors=colors, radii=rr.Radius.ui_points(size_ui)))

    def points_at(self, entity: str, time_s: Times, at_m: Floats, *, names: Sequence[str] | None = None,
                  colors: Colors | None = None, counts: Sequence[int] | None = None) -> None:
        """Write points over time, shape (n, 3)."""
        self._column(entity, time_s, rr.Points3D.columns(positions=at_m, labels=names, colors=colors), counts)

    def names(self, entity: str, names: Sequence[str] | None = None, at_m: Floats | None = None) -> None:
        """Names, each just below its point; labels of solids would have the solid's colour, and be hard to read.

        Args:
            entity: Its path.
            names: The names; ``None`` = they are written by ``points_at``.
            at_m: Their points, shape (n, 3); ``None`` = likewise.
        """
        self._constant(entity, rr.Points3D.from_fields(
            positions=at_m, radii=rr.Radius.ui_points(0.0), colors=[_NAMES], labels=names, show_labels=True))

    def series(self, entity: str, time_s: Times, values: FloatArray, *, name: str, color: Color, steps: bool,
               width: float) -> None:
        """Write a number over time as a line of a chart.

        Args:
            entity, time_s: Its path, and moments.
            values: The numbers, shape (m,).
            name, color, width: What its legend says, its colour, and its width in points of the screen.
            steps: Whether each number holds until the next; else it changes evenly from one to the next.
        """
        self._constant(entity, rr.SeriesLines(
            names=name, colors=[color], widths=width, interpolation_mode="StepAfter" if steps else "Linear"))
        self._column(entity, time_s, rr.Scalars.columns(scalars=values))

    def marks(self, entity: str, time_s: Times, height: float, *, name: str, color: Color,
              marker: Literal["cross", "diamond"], size_ui: float) -> None:
        """Write marks of a chart, all at one height of it."""
        self._constant(entity, rr.SeriesPoints(
            names=name, colors=[color], markers=_MARKERS[marker], marker_sizes=size_ui))
        self._column(entity, time_s, rr.Scalars.columns(scalars=[height] * len(time_s)))

    def states(self, entity: str, time_s: Times, states: Sequence[RobotState], colors: Mapping[RobotState, Color]
               ) -> None:
        """Write a lane of states, m of them, in the colours of the states that there are."""
        self._constant(entity, rr.StateConfiguration(
            values=list(colors), colors=[(*color, 255) for color in colors.values()]))
        self._column(entity, time_s, rr.StateChange.columns(state=list(states)))

    def log(self, entity: str, time_s: Times, texts: Sequence[str], levels: Sequence[str], colors: Colors) -> None:
        """Write entries of a log, m of each."""
        self._column(entity, time_s, rr.TextLog.columns(text=texts, level=levels, color=colors))

    def text(self, entity: str, markdown: str) -> None:
        """Write a text."""
        self._constant(entity, rr.TextDocument(markdown, media_type="text/markdown"))

    def lay_out(self, layout: Layout) -> None:
        """Say how the recording is shown."""
        # Made active: the viewer in a browser takes no default from a file.
        self.stream.send_blueprint(_blueprint(layout))

    def _constant(self, entity: str, shapes: rr.AsComponents) -> None:
        self.stream.log(f"{self.path}{entity}", shapes, static=True, strict=True)

    def _column(self, entity: str, time_s: Times, columns: rr.ComponentColumnList, counts: Sequence[int] | None = None
                ) -> None:
        # Rounded here: rerun cuts off, and 0.29 s would become 0.289999999 s.
        nanoseconds = np.round(np.asarray(time_s, dtype=np.float64) * 1e9).astype("timedelta64[ns]")
        self.stream.send_columns(
            f"{self.path}{entity}", [rr.TimeColumn(TIMELINE, duration=nanoseconds)],
            columns if counts is None else columns.partition(counts), strict=True)


def part(name: str) -> str:
    """A name as one part of an entity's path, whatever it holds."""
    return str(rr.escape_entity_path_part(name))


def recorded(write: Callable[[Pen], None], *, application: str, identity: str, title: str, layout: Layout,
             properties: Mapping[str, str | int | float]) -> bytes:
    """The content of a recording's file.

    Args:
        write: Writes it.
        application: What the viewer keeps layouts for.
        identity: Recordings of the same identity are one.
        title, layout: What the viewer calls it, and how it is shown.
        properties: What the mission is.
    """
    try:
        return _encoded(write, application, identity, title, layout, properties)
    finally:
        # Else the library keeps two threads of each recording to the end of the process, and they wake all the time;
        # those of the layout, which it sends on a stream of its own, it keeps all the same.
        flush_and_cleanup_orphaned_recordings()


def _encoded(write: Callable[[Pen], None], application: str, identity: str, title: str, layout: Layout,
             properties: Mapping[str, str | int | float]) -> bytes:
    pen = _opened(application, recording_id=identity, send_properties=False)
    try:
        # In memory: on a full disk the library's writer thread would hang.
        memory = pen.stream.memory_recording()
        pen.lay_out(layout)
        pen.stream.send_recording_name(title)
        if properties:
            pen.stream.send_property("mission", rr.AnyValues(drop_untyped_nones=True, **properties))
        write(pen)
        pen.stream.flush()
        return memory.drain_as_bytes()
    finally:
        pen.stream.disconnect()


def pen_to_viewer(application: str, port: int) -> Pen:
    """A pen whose strokes are seen at once, in the viewer that listens at a port of this machine."""
    pen = _opened(application)
    pen.stream.connect_grpc(_address(port))
    return pen


def _opened(application: str, **options: Any) -> Pen:
    """A pen for a new recording, in which there is no clock but the mission's."""
    stream = rr.RecordingStream(application, **options)
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    return Pen(stream=stream)


def _address(port: int) -> str:
    return f"rerun+http://127.0.0.1:{port}/proxy"


def _blueprint(layout: Layout) -> rrb.Blueprint:
    return rrb.Blueprint(
        _panel(layout.panel), rrb.BlueprintPanel(state="collapsed"), rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, playback_speed=layout.speed,
                      play_state="following" if layout.speed is None else "playing"),
        auto_layout=False, auto_views=False)


def _panel(panel: Panel) -> rrb.View | rrb.Container:
    match panel:
        case Row():
            return rrb.Horizontal(*map(_panel, panel.panels), column_shares=panel.shares or None)
        case Column():
            return rrb.Vertical(*map(_panel, panel.panels), row_shares=panel.shares or None)
        case Tabs():
            return rrb.Tabs(*map(_panel, panel.panels), active_tab=0)
        case TextView():
            return rrb.TextDocumentView(origin=panel.origin, name=panel.name)
        case LogView():
            return rrb.TextLogView(
                origin=panel.origin, name=panel.name, columns=rrb.TextLogColumns(
                    timeline_columns=[TIMELINE], text_log_columns=["LogLevel", "Body"]),
                rows=rrb.TextLogRows(filter_by_log_level=["INFO", "WARN", "ERROR"]))
        case StatesView():
            return rrb.StateTimelineView(origin=panel.origin, name=panel.name, time_view=_until(panel.end_s))
        case ChartView():
            return rrb.TimeSeriesView(
                origin=panel.origin, name=panel.name, axis_x=_until(panel.end_s),
                axis_y=rrb.ScalarAxis(range=panel.values), plot_legend=_CORNERS[panel.legend])
        case MapView():
            return _map(panel)


def _until(end_s: float) -> rrb.TimeAxis:
    return rrb.TimeAxis(view_range=rr.TimeRange(
        start=rr.TimeRangeBoundary.absolute(seconds=0.0), end=rr.TimeRangeBoundary.absolute(seconds=end_s)))


def _map(view: MapView) -> rrb.Spatial3DView:
    so_far = rrb.VisibleTimeRanges(
        timeline=TIMELINE, start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.cursor_relative())
    return rrb.Spatial3DView(
        origin=view.origin, name=view.name, background=rrb.Background(kind="SolidColor", color=_BACKGROUND),
        line_grid=False, eye_controls=rrb.EyeControls3D(
            kind="Orbital", position=view.eye_m, look_target=view.target_m, eye_up=(0, 0, 1)),
        overrides=dict.fromkeys(view.kept, so_far))


@dataclass(frozen=True, eq=False, kw_only=True)
class Held:
    """What a recording holds of one component of an entity, row by row.

    Attributes:
        entity: Path of the entity.
        component: Name of the component.
        time_ns: When it is so [ns]; ``None`` = all the time.
        values: What it is.
    """

    entity: str
    component: str
    time_ns: Sequence[int] | None
    values: Sequence[object]


def held_in(path: Path) -> Iterator[Held]:
    """All that a recording holds, in the order in which it was written."""
    for chunk in RrdReader(path).stream():
        rows = chunk.to_record_batch()
        times = rows.column(TIMELINE).cast("int64").to_pylist() if TIMELINE in chunk.timeline_names else None
        if times is None and not chunk.is_static:
            continue  # on a clock that is none of ours
        for component in rows.schema.names:
            if component != TIMELINE:
                yield Held(entity=chunk.entity_path.removeprefix("/"), component=component, time_ns=times,
                           values=rows.column(component).to_pylist())


def end_s(path: Path) -> float:
    """Last moment of a recording [s]."""
    timed = (chunk.to_record_batch() for chunk in RrdReader(path).stream() if TIMELINE in chunk.timeline_names)
    return max((int(rows.column(TIMELINE).cast("int64").to_numpy().max()) for rows in timed), default=0) / 1e9


def photograph(port: int, path: Path, picture: Path, at_s: float) -> None:
    """Have the viewer that listens at a port of this machine open a recording and save what it shows.

    Raises:
        RuntimeError: If the viewer doesn't answer, or can't.
    """
    client = ViewerClient.connect(_address(port))
    for _ in range(_NOTICE_TRIES):  # a slow viewer tells where it listens; what would come later is not told
        client.save_screenshot(str(picture.resolve()))
        if not has_notice(picture.read_bytes()):
            break
        time.sleep(_SETTLE_S)
    client.open(str(path.resolve()))
    client.set_time(TIMELINE, duration=at_s, play_state="paused")
    _hide_panels(client)
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


def _hide_panels(client: ViewerClient) -> None:
    """Take the viewer's own menu, notices and panels away, and leave the views.

    Raises:
        RuntimeError: If the layout of the recording doesn't arrive.
    """
    for _ in range(_SETTLE_TRIES):
        layout = client.get_blueprint(of="recording").blueprint
        if "/time_panel" in layout:
            break
        time.sleep(_SETTLE_S)
    else:
        raise RuntimeError("it did not take the recording's layout")
    for panel in ("top_panel", "blueprint_panel", "selection_panel", "time_panel"):
        kind = "TimePanelBlueprint" if panel == "time_panel" else "PanelBlueprint"
        layout.setdefault(f"/{panel}", {}).setdefault(kind, {})["state"] = "Hidden"
    client.set_blueprint(layout, of="recording")
