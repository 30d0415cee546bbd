"""The layouts in which recordings are shown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from sva_bench.recording.story import Story
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

_PLAY_S = 30.0  # a mission is played in about this time


def layout_of(story: Story) -> Layout:
    """The map over a lane of states for each robot at the left; words, fuel and speed, incentive and log at the right.
    """
    end_s = float(story.total.time_s[-1])
    most_fuel = max((float(robot.fuel.value.max()) for robot in story.views if robot.fuel is not None), default=0.0)
    most_speed = max((float(robot.speed.value.max()) for robot in story.views), default=0.0)
    fuel = ChartView(origin="fuel", name="Fuel left [s of driving]", end_s=end_s, values=_from_zero(most_fuel),
                     legend="left_bottom")
    speed = ChartView(origin="speed", name="Speed [m/s]", end_s=end_s, values=_from_zero(most_speed),
                      legend="left_bottom")
    limited = any(robot.fuel is not None for robot in story.views)
    right: list[Panel] = [
        TextView(origin="about", name="Mission"), Tabs([fuel, speed]) if limited else speed,
        ChartView(origin="collected", name="Incentive collected", end_s=end_s,
                  values=_from_zero(float(story.total.value[-1])), legend="left_top")]
    # Text and legend have a line for each robot, and there is more to say of the marks where one is lost.
    shares = [3.6 + 0.6 * len(story.views) + 0.9 * bool(story.lost), 3, 2.4 + 0.25 * len(story.views)]
    if story.lanes:
        right.append(ChartView(
            origin="news", name="Who was lost, and who learned of it when", end_s=end_s,
            values=(-len(story.views) + 0.4, 0.6), legend="right_top"))
        shares[0] += 1  # there is more to say of the marks
        shares.append(2)
    right.append(LogView(origin="events", name="Events"))
    left = Column([_map("", story), _states("", end_s)], [10, _lanes_share(len(story.views))])
    return Layout(panel=Row([left, Column(right, [*shares, 3.5])], [13, 7]), speed=_speed(story))


def layout_of_pair(stories: Mapping[str, Story]) -> Layout:
    """Two maps side by side; below them what both plans collect, what robots do, and how they ended.

    Args:
        stories: The plans' stories by the path of their entities.
    """
    longest = max(stories.values(), key=lambda story: story.duration_s)
    end_s = float(longest.total.time_s[-1])
    most = max(float(story.total.value[-1]) for story in stories.values())
    maps = Row([_map(path, story) for path, story in stories.items()])
    states = Row([_states(path, end_s) for path in stories])
    lanes = _lanes_share(max(len(story.views) for story in stories.values()))
    told = [Tabs([TextView(origin=f"{path}about", name="Mission"), LogView(origin=f"{path}events", name="Events")])
            for path in stories]
    chart = ChartView(origin="compared", name="Incentive collected by all robots", end_s=end_s,
                      values=_from_zero(most), legend="left_top")
    return Layout(panel=Column([maps, states, Row([told[0], chart, *told[1:]])], [10, 1.6 * lanes, 7]),
                  speed=_speed(longest))


def layout_of_drives(title: str, kinds: Sequence[str], eye_m: Sequence[float], target_m: Sequence[float]) -> Layout:
    """The map alone, followed as robots drive; of the lines that they leave all are seen."""
    return Layout(panel=MapView(origin="world", name=title, eye_m=eye_m, target_m=target_m,
                                kept=[f"world/drives/{kind}/line" for kind in kinds]), speed=None)


def _speed(story: Story) -> float:
    return max(1.0, round(story.duration_s / _PLAY_S))


def _map(path: str, story: Story) -> MapView:
    return MapView(
        origin=f"{path}world", name=story.title, eye_m=story.eye_m, target_m=story.target_m, kept=[
            *(f"{path}world/driven/{robot.name}" for robot in story.views if len(robot.trail)),
            *(f"{path}world/contacts/{touched.robot}{of}" for touched in story.touched for of in ("", "/what"))])


def _states(path: str, end_s: float) -> StatesView:
    return StatesView(origin=f"{path}states", name="What robots do", end_s=end_s)


def _lanes_share(robots: int) -> float:
    """Height of lanes of states, in tenths of that of the map."""
    return 1.2 + 0.55 * robots


def _from_zero(most: float) -> tuple[float, float]:
    """An axis from nought to ``most``, with a little room so that no line runs along the frame."""
    return (-0.03 * most, 1.06 * most) if most > 0 else (0.0, 1.0)
