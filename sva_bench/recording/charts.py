"""What is seen beside the map: fuel, incentive, speed and states over time, the log, and what the recording is of."""

from __future__ import annotations

import numpy as np

from sva_bench.recording.colors import ALARM, Color, pale
from sva_bench.recording.rerun import Pen
from sva_bench.recording.states import STATE_COLORS
from sva_bench.recording.story import Series, Story

_TOTAL: Color = (190, 190, 190)
_MARK_UI = 6.0  # size of marks in the lanes of news


def write_charts(pen: Pen, story: Story) -> None:
    """Write all that is seen beside the map."""
    _write_lanes(pen, story)
    _write_numbers(pen, story)
    _write_states(pen, story)
    _write_log(pen, story)
    pen.text("about", story.text)


def _write_states(pen: Pen, story: Story) -> None:
    """What each robot is doing, from each change on."""
    for lane in story.states:
        pen.states(f"states/{lane.robot}", lane.time_s, lane.states, STATE_COLORS)


def _write_lanes(pen: Pen, story: Story) -> None:
    """A lane for each robot: a cross where it was lost, and a mark each time that it learned of a failure."""
    for lane in story.lanes:
        if len(lane.lost_s):
            pen.marks(f"news/{lane.robot}/lost", lane.lost_s, lane.height, name=f"{lane.robot} lost", color=ALARM,
                      marker="cross", size_ui=_MARK_UI)
        if len(lane.learned_s):
            pen.marks(f"news/{lane.robot}/learned", lane.learned_s, lane.height, name=f"{lane.robot} learned",
                      color=lane.color, marker="diamond", size_ui=_MARK_UI)


def _line(pen: Pen, entity: str, series: Series, name: str, color: Color, *, steps: bool, width: float = 2.0) -> None:
    pen.series(entity, series.time_s, series.value, name=name, color=color, steps=steps, width=width)


def _write_numbers(pen: Pen, story: Story) -> None:
    if len(story.views) > 1:
        _line(pen, "collected/total", story.total, "all", _TOTAL, steps=True, width=3.0)
    for robot in story.views:
        _line(pen, f"collected/{robot.name}", robot.collected, robot.name, robot.color, steps=True)
        if robot.fuel is not None:
            _line(pen, f"fuel/{robot.name}", robot.fuel, robot.name, robot.color, steps=False)
        _line(pen, f"speed/{robot.name}", robot.speed, robot.name, robot.color, steps=False)


def write_total(pen: Pen, entity: str, story: Story, name: str, color: Color, end_s: float) -> None:
    """Write what all robots of a story collect, as one line of a chart that goes on to some time [s]."""
    total = story.total
    if total.time_s[-1] < end_s:
        total = Series(time_s=np.append(total.time_s, end_s), value=np.append(total.value, total.value[-1]))
    _line(pen, entity, total, name, color, steps=True, width=3.0)


def _write_log(pen: Pen, story: Story) -> None:
    if story.log:
        pen.log("events", [s.time_s for s in story.log], [s.text for s in story.log], [s.level for s in story.log],
                [pale(s.color) for s in story.log])
