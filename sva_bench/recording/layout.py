"""The layouts in which recordings are shown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import rerun as rr
import rerun.blueprint as rrb

from sva_bench.recording.colors import Color
from sva_bench.recording.pen import TIMELINE
from sva_bench.recording.story import Story

_BACKGROUND: Color = (28, 30, 34)  # as dark as the viewer's other panels
_PLAY_S = 30.0  # a mission is played in about this time


def layout_of(story: Story) -> rrb.Blueprint:
    """The map over a lane of states for each robot at the left; words, fuel and speed, incentive and log at the right.
    """
    axis = _axis(float(story.total.time_s[-1]))
    most_fuel = max((float(robot.fuel.value.max()) for robot in story.views if robot.fuel is not None), default=0.0)
    most_speed = max((float(robot.speed.value.max()) for robot in story.views), default=0.0)
    fuel = rrb.TimeSeriesView(origin="fuel", name="Fuel left [s of driving]", axis_x=axis, axis_y=_from_zero(most_fuel),
                              plot_legend=rrb.Corner2D.LeftBottom)
    speed = rrb.TimeSeriesView(origin="speed", name="Speed [m/s]", axis_x=axis, axis_y=_from_zero(most_speed),
                               plot_legend=rrb.Corner2D.LeftBottom)
    limited = any(robot.fuel is not None for robot in story.views)
    right: list[rrb.View | rrb.Container] = [
        rrb.TextDocumentView(origin="about", name="Mission"),
        rrb.Tabs(fuel, speed, active_tab=0) if limited else speed,
        rrb.TimeSeriesView(origin="collected", name="Incentive collected", axis_x=axis,
                           axis_y=_from_zero(float(story.total.value[-1])), plot_legend=rrb.Corner2D.LeftTop)]
    # Text and legend have a line for each robot, and there is more to say of the marks where one is lost.
    shares = [3.6 + 0.6 * len(story.views) + 0.9 * bool(story.lost), 3, 2.4 + 0.25 * len(story.views)]
    if story.lanes:
        right.append(rrb.TimeSeriesView(
            origin="news", name="Who was lost, and who learned of it when", axis_x=axis,
            axis_y=rrb.ScalarAxis(range=(-len(story.views) + 0.4, 0.6)), plot_legend=rrb.Corner2D.RightTop))
        shares[0] += 1  # there is more to say of the marks
        shares.append(2)
    right.append(_log("events", "Events"))
    left = rrb.Vertical(_map("", story), _states("states", axis), row_shares=[10, _lanes_share(len(story.views))])
    return _whole(rrb.Horizontal(left, rrb.Vertical(*right, row_shares=[*shares, 3.5]), column_shares=[13, 7]), story)


def layout_of_pair(stories: Mapping[str, Story]) -> rrb.Blueprint:
    """Two maps side by side; below them what both plans collect, what robots do, and how they ended.

    Args:
        stories: The plans' stories by the path of their entities.
    """
    longest = max(stories.values(), key=lambda story: story.duration_s)
    axis = _axis(float(longest.total.time_s[-1]))
    most = max(float(story.total.value[-1]) for story in stories.values())
    maps = rrb.Horizontal(*(_map(path, story) for path, story in stories.items()))
    states = rrb.Horizontal(*(_states(f"{path}states", axis) for path in stories))
    lanes = _lanes_share(max(len(story.views) for story in stories.values()))
    told = [rrb.Tabs(rrb.TextDocumentView(origin=f"{path}about", name="Mission"), _log(f"{path}events", "Events"),
                     active_tab=0) for path in stories]
    chart = rrb.TimeSeriesView(origin="compared", name="Incentive collected by all robots", axis_x=axis,
                               axis_y=_from_zero(most), plot_legend=rrb.Corner2D.LeftTop)
    charts = rrb.Horizontal(told[0], chart, *told[1:])
    return _whole(rrb.Vertical(maps, states, charts, row_shares=[10, 1.6 * lanes, 7]), longest)


def layout_of_drives(title: str, kinds: Sequence[str], eye_m: Sequence[float], target_m: Sequence[float]
                     ) -> rrb.Blueprint:
    """The map alone, followed as robots drive; of the lines that they leave all are seen."""
    whole = rrb.VisibleTimeRanges(
        timeline=TIMELINE, start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.cursor_relative())
    space = rrb.Spatial3DView(
        origin="world", name=title, background=rrb.Background(kind="SolidColor", color=_BACKGROUND), line_grid=False,
        eye_controls=rrb.EyeControls3D(kind="Orbital", position=eye_m, look_target=target_m, eye_up=(0, 0, 1)),
        overrides=dict.fromkeys([f"world/drives/{kind}/line" for kind in kinds], whole))
    return rrb.Blueprint(
        space, rrb.BlueprintPanel(state="collapsed"), rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="following"), auto_layout=False,
        auto_views=False)


def _whole(views: rrb.Container, story: Story) -> rrb.Blueprint:
    return rrb.Blueprint(
        views, rrb.BlueprintPanel(state="collapsed"), rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="playing",
                      playback_speed=max(1.0, round(story.duration_s / _PLAY_S))),
        auto_layout=False, auto_views=False)


def _map(path: str, story: Story) -> rrb.Spatial3DView:
    whole_trail = rrb.VisibleTimeRanges(
        timeline=TIMELINE, start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.cursor_relative())
    return rrb.Spatial3DView(
        origin=f"{path}world", name=story.title, background=rrb.Background(kind="SolidColor", color=_BACKGROUND),
        line_grid=False, eye_controls=rrb.EyeControls3D(
            kind="Orbital", position=story.eye_m, look_target=story.target_m, eye_up=(0, 0, 1)),
        overrides=dict.fromkeys([
            *(f"{path}world/driven/{robot.name}" for robot in story.views if len(robot.trail)),
            *(f"{path}world/contacts/{touched.robot}{of}" for touched in story.touched for of in ("", "/what"))],
            whole_trail))


def _states(origin: str, axis: rrb.TimeAxis) -> rrb.StateTimelineView:
    return rrb.StateTimelineView(origin=origin, name="What robots do", time_view=axis)


def _lanes_share(robots: int) -> float:
    """Height of lanes of states, in tenths of that of the map."""
    return 1.2 + 0.55 * robots


def _log(origin: str, name: str) -> rrb.TextLogView:
    return rrb.TextLogView(
        origin=origin, name=name, columns=rrb.TextLogColumns(
            timeline_columns=[TIMELINE], text_log_columns=["LogLevel", "Body"]),
        rows=rrb.TextLogRows(filter_by_log_level=["INFO", "WARN", "ERROR"]))


def _axis(duration_s: float) -> rrb.TimeAxis:
    return rrb.TimeAxis(view_range=rr.TimeRange(
        start=rr.TimeRangeBoundary.absolute(seconds=0.0),
        end=rr.TimeRangeBoundary.absolute(seconds=duration_s)))


def _from_zero(most: float) -> rrb.ScalarAxis:
    """An axis from nought to ``most``, with a little room so that no line runs along the frame."""
    return rrb.ScalarAxis(range=(-0.03 * most, 1.06 * most) if most > 0 else (0.0, 1.0))
