"""Missions written as recordings: one trial, or one trial of two plans under the same failures."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from sva_bench.execution.outcome import Trace
from sva_bench.execution.team_trace import NewsHeard
from sva_bench.files.atomic import by_way_of
from sva_bench.palette import plan_color
from sva_bench.recording.about import About
from sva_bench.recording.charts import write_charts, write_total
from sva_bench.recording.drawn import write_map
from sva_bench.recording.layout import layout_of, layout_of_pair
from sva_bench.recording.rerun import Pen, part, recorded
from sva_bench.recording.story import Story, story_of
from sva_bench.recording.views import Layout
from sva_bench.world.model import World


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


def _write(path: Path, title: str, stories: Mapping[str, Story], layout: Layout,
           properties: Mapping[str, str | int | float]) -> None:
    """Write stories, each below its path, as one recording."""
    def write(pen: Pen) -> None:
        for below, story in stories.items():
            write_map(pen.below(below), story)
            write_charts(pen.below(below), story)
        if len(stories) > 1:
            _write_compared(pen, stories)

    # Layouts are kept per application id, so each recording has its own. The recording's id follows from its content:
    # the same trial is the same recording, and two that are opened together stay apart.
    content = recorded(write, application=_application(title), identity=_identity(title, stories), title=title,
                       layout=layout, properties=properties)
    unfinished = path.with_name(f"{path.name}.tmp")
    with by_way_of(unfinished, path):
        unfinished.write_bytes(content)


def _application(title: str) -> str:
    """The application id of a recording: what it is called, in the characters that such an id may have."""
    return f"sva-bench {re.sub('[^A-Za-z0-9_ -]+', '-', title.replace(', ', ' '))}".rstrip(" -")


def _write_compared(pen: Pen, stories: Mapping[str, Story]) -> None:
    """What both plans collect, in one chart, and what both are, in one text."""
    end_s = max(float(story.total.time_s[-1]) for story in stories.values())
    for number, (below, story) in enumerate(stories.items()):
        name = str(story.properties["planner"])
        write_total(pen, f"compared/{below.removesuffix('/')}", story, name, plan_color(name, number), end_s)
    pen.text("about", "\n\n---\n\n".join(story.text for story in stories.values()))


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
