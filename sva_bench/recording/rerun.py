"""Stories written as Rerun recordings, and screenshots by the viewer.

Rerun is imported here and in what writes parts of a recording: ``pen``, ``drawn``, ``charts`` and ``layout``.
"""

from __future__ import annotations

import hashlib
import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader
from rerun.experimental import ViewerClient
from rerun_bindings import flush_and_cleanup_orphaned_recordings

from sva_bench.execution.outcome import Trace
from sva_bench.execution.team_trace import NewsHeard
from sva_bench.files.atomic import by_way_of
from sva_bench.palette import plan_color
from sva_bench.recording.about import About
from sva_bench.recording.charts import write_charts, write_total
from sva_bench.recording.drawn import write_map
from sva_bench.recording.layout import layout_of, layout_of_pair
from sva_bench.recording.pen import TIMELINE as TIMELINE
from sva_bench.recording.pen import Pen, part
from sva_bench.recording.pictures import has_notice
from sva_bench.recording.story import Story, story_of
from sva_bench.world.model import World

_SETTLE_S, _SETTLE_TRIES = 0.5, 40  # between pictures; a third or fourth one is the last, on a slow machine a tenth

_NOTICE_TRIES = 16  # as often as it is looked whether a notice is gone: it lasts some seconds


@dataclass(frozen=True, eq=False, kw_only=True)
class Side:
    """One plan of a recording that shows two under the same failures.

    Attributes:
        about: What it is of.
        traces: One per robot at most, of one trial.
        routes: Stops of each robot as planned.
        news: News of failures that the team heard.
    """

    about: About
    traces: Sequence[Trace]
    routes: Mapping[str, Sequence[str]]
    news: Sequence[NewsHeard] = ()


def record(
    path: Path, world: World, traces: Sequence[Trace], *, title: str, news: Sequence[NewsHeard] = (),
    about: About | None = None, routes: Mapping[str, Sequence[str]] | None = None,
) -> None:
    """Write one trial as a recording, with the layout that it is shown in.

    Args:
        path: The ``.rrd`` file; its folder exists. It appears under this name when it is complete.
        world: The world.
        traces: One per robot at most, of one trial.
        title: What the viewer calls the recording.
        news: News of failures that the team heard, and what it made of it.
        about: What it is of; ``None`` = nobody says.
        routes: Stops of each robot as planned; ``None`` = those of the traces' orders.

    Raises:
        ValueError: If the traces don't belong to the world.
    """
    story = story_of(world, traces, title, news, about, routes)
    _write(path, title, {"": story}, layout_of(story), story.properties)


def record_pair(path: Path, world: World, sides: Sequence[Side], *, title: str) -> None:
    """Write one trial of two plans under the same failures as a recording, side by side.

    The entities of each plan stand below its name.

    Args:
        path, world, title: As for ``record``.
        sides: The plans.

    Raises:
        ValueError: If the traces don't belong to the world.
    """
    stories = {f"{part(side.about.planner)}/": story_of(
        world, side.traces, f"{side.about.planner} plan", side.news, side.about, side.routes) for side in sides}
    first = sides[0].about
    common: dict[str, str | int | float] = {
        "world": world.name, "scenario": first.scenario, "trial": first.trial, "seed": first.seed,
              "fidelity": first.fidelity, "chosen": first.kind, "planners": ", ".join(s.about.planner for s in sides)}
    values = {f"value of {side.about.planner}": story.properties["value"]
              for side, story in zip(sides, stories.values(), strict=True)}
    _write(path, title, stories, layout_of_pair(stories), {**common, **values})


def _write(path: Path, title: str, stories: Mapping[str, Story], layout: rrb.Blueprint,
           properties: Mapping[str, str | int | float]) -> None:
    """Write stories, each below its path, as one recording."""
    try:
        content = _encoded(title, stories, layout, properties)
    finally:
        # Else the library keeps two threads of each recording to the end of the process, and they wake all the time;
        # those of the layout, which it sends on a stream of its own, it keeps all the same.
        flush_and_cleanup_orphaned_recordings()
    unfinished = path.with_name(f"{path.name}.tmp")
    with by_way_of(unfinished, path):
        unfinished.write_bytes(content)


def _encoded(title: str, stories: Mapping[str, Story], layout: rrb.Blueprint,
             properties: Mapping[str, str | int | float]) -> bytes:
    # Layouts are kept per application id, so each recording has its own. The recording's id follows from its content:
    # the same trial is the same recording, and two that are opened together stay apart.
    recording = rr.RecordingStream(_application(title), recording_id=_identity(title, stories), send_properties=False)
    try:
        recording.set_log_time_enabled(False)
        recording.set_log_tick_enabled(False)
        # In memory: on a full disk the library's writer thread would hang.
        memory = recording.memory_recording()
        recording.send_blueprint(layout)  # made active: the viewer in a browser takes no default from a file
        recording.send_recording_name(title)
        if properties:
            recording.send_property("mission", rr.AnyValues(drop_untyped_nones=True, **properties))
        for below, story in stories.items():
            pen = Pen(stream=recording, below=below)
            write_map(pen, story)
            write_charts(pen, story)
        if len(stories) > 1:
            _write_compared(Pen(stream=recording), stories)
        recording.flush()
        return memory.drain_as_bytes()
    finally:
        recording.disconnect()


def _application(title: str) -> str:
    """The application id of a recording: what it is called, in the characters that such an id may have."""
    return f"sva-bench {re.sub('[^A-Za-z0-9_ -]+', '-', title.replace(', ', ' '))}".rstrip(" -")


def _write_compared(pen: Pen, stories: Mapping[str, Story]) -> None:
    """What both plans collect, in one chart, and what both are, in one text."""
    end_s = max(float(story.total.time_s[-1]) for story in stories.values())
    for number, (below, story) in enumerate(stories.items()):
        name = str(story.properties["planner"])
        write_total(pen, f"compared/{below.removesuffix('/')}", story, name, plan_color(name, number), end_s)
    pen.constant("about", rr.TextDocument("\n\n---\n\n".join(story.text for story in stories.values()),
                                          media_type="text/markdown"))


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


def _identity(title: str, stories: Mapping[str, Story]) -> str:
    digest = hashlib.sha256(f"{title}".encode())
    for below, story in stories.items():
        digest.update(f"\0{below}\0{story.world}\0{story.title}".encode())
        for robot in story.views:
            digest.update(robot.name.encode())
            digest.update(robot.time_s.tobytes() + robot.pose.tobytes())
        for sentence in story.log:
            digest.update(f"{sentence.time_s!r}{sentence.text}".encode())
    return digest.hexdigest()[:32]
