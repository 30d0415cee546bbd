"""What is seen beside the map: fuel, incentive, speed and states over time, the log, and what the recording is of."""

from __future__ import annotations

import numpy as np
import rerun as rr

from sva_bench.recording.colors import ALARM, Color, pale
from sva_bench.recording.pen import Pen
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
    pen.constant("about", rr.TextDocument(story.text, media_type="text/markdown"))


def _write_states(pen: Pen, story: Story) -> None:
    """What each robot is doing, from each change on."""
    for lane in story.states:
        entity = f"states/{lane.robot}"
        pen.constant(entity, rr.StateConfiguration(
            values=list(STATE_COLORS), colors=[(*color, 255) for color in STATE_COLORS.values()]))
        pen.column(entity, lane.time_s, rr.StateChange.columns(state=list(lane.states)))


def _write_lanes(pen: Pen, story: Story) -> None:
    """A lane for each robot: a cross where it was lost, and a mark each time that it learned of a failure."""
    for lane in story.lanes:
        for name, times, marker, color in (("lost", lane.lost_s, rr.components.MarkerShape.Cross, ALARM),
                                           ("learned", lane.learned_s, rr.components.MarkerShape.Diamond, lane.color)):
            if len(times):
                entity = f"news/{lane.robot}/{name}"
                pen.constant(entity, rr.SeriesPoints(
                    names=f"{lane.robot} {name}", colors=[color], markers=marker, marker_sizes=_MARK_UI))
                pen.column(entity, times, rr.Scalars.columns(scalars=[lane.height] * len(times)))


def _line(pen: Pen, entity: str, series: Series, name: str, color: Color, *, steps: bool, width: float = 2.0) -> None:
    pen.constant(entity, rr.SeriesLines(
        names=name, colors=[color], widths=width, interpolation_mode="StepAfter" if steps else "Linear"))
    pen.column(entity, series.time_s, rr.Scalars.columns(scalars=series.value))


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
        pen.column("events", [s.time_s for s in story.log], rr.TextLog.columns(
            text=[s.text for s in story.log], level=[s.level for s in story.log],
            color=[pale(s.color) for s in story.log]))
