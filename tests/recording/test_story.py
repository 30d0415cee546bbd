from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from sva_bench.execution.outcome import Event
from sva_bench.recording.colors import ALARM, BLUE, PURPLE, ROBOT_COLORS, VERMILLION, YELLOW, pale
from sva_bench.recording.log import Level
from sva_bench.recording.standing import raised_by
from sva_bench.recording.story import Story, corners, dashes, story_of
from tests.recording.missions import WORLD, mission_with_news, trace


def entries(story: Story) -> list[tuple[float, Level, str]]:
    return [(sentence.time_s, sentence.level, sentence.text) for sentence in story.log]


def test_events_are_logged_in_order_of_time() -> None:
    # p1 after 2 m, r1 after 2 m more and 2 s of refuelling, p2 after 2 m, 6 m home; all at 1 m/s.
    story = story_of(WORLD, [trace("uv1")], "tour")
    assert entries(story) == [
        (0.0, "INFO", "uv1 left base"), (2.0, "DEBUG", "uv1 reached p1"), (2.0, "INFO", "uv1 collected p1: 30"),
        (4.0, "DEBUG", "uv1 reached r1"), (6.0, "INFO", "uv1 refuelled at r1"), (8.0, "DEBUG", "uv1 reached p2"),
        (8.0, "INFO", "uv1 collected p2: 12.5"), (14.0, "DEBUG", "uv1 reached base"),
        (14.0, "INFO", "uv1 came home, with 42.5 collected")]
    assert story.duration_s == 14


def test_failed_and_stuck_robots_are_logged_and_stop_for_good() -> None:
    late = trace("uv1", limit_s=5.0)  # p2 is reached after 8 s
    empty = trace("uv2", fuel_s=3.0)  # r1 is 4 s away
    failed = trace("uv3", fails_before=2)  # on leaving r1 for p2, at 6 s
    story = story_of(WORLD, [failed, late, empty], "unhappy")  # in any order
    texts = [entry for entry in entries(story) if entry[1] in ("WARN", "ERROR")]
    assert texts == [
        (3.0, "ERROR", "uv2 ran out of fuel on the way to r1, with 30 collected"),
        (6.0, "WARN", "uv1 passed its limit of 5 s at r1: earns no more"),
        (6.0, "ERROR", "uv3 failed at r1, with 30 collected"),
        (14.0, "WARN", "uv1 came home late, with 30 collected")]
    assert [(robot.name, robot.disabled_s) for robot in story.views] == [("uv1", None), ("uv2", 3.0), ("uv3", 6.0)]
    stuck = story_of(WORLD, [trace("uv1", ("base", "p1"), stuck=True)], "stuck")
    assert entries(stuck)[-1] == (2.0, "ERROR", "uv1 got stuck on the way to p1, with 0 collected")


def test_a_poi_takes_the_colour_of_the_robot_that_collected_it_first() -> None:
    # uv2 goes to p2 at once (6 s), uv1 comes there after 8 s; p1 is uv1's after 2 s and uv2's on the way home (10 s).
    story = story_of(WORLD, [trace("uv1"), trace("uv2", ("base", "p2", "p1", "base"))], "two")
    (pois,) = (marks for marks in story.marks if marks.kind == "poi")
    assert_array_equal(pois.time_s, [0, 2, 6])
    assert_array_equal(pois.colors, [[YELLOW, YELLOW], [BLUE, YELLOW], [BLUE, VERMILLION]])


def test_a_robot_keeps_its_colour_whoever_else_is_shown() -> None:
    assert story_of(WORLD, [trace("uv3")], "alone").views[0].color == ROBOT_COLORS[2]


def test_fuel_falls_while_driving_and_rises_during_the_refuelling_stop() -> None:
    fuel = story_of(WORLD, [trace("uv1")], "tour").views[0].fuel
    assert fuel is not None
    # 20 s at first, 16 s left at r1 (4 s), full again when the stop is over (6 s), 8 s more to drive.
    assert_allclose(np.column_stack([fuel.time_s, fuel.value]), [[0, 20], [4, 16], [6, 20], [14, 12]], atol=1e-9)


def test_fuel_without_a_limit_is_not_shown() -> None:
    assert story_of(WORLD, [trace("uv3")], "no limit").views[0].fuel is None


def test_the_total_is_the_sum_of_the_robots_and_ends_with_the_mission() -> None:
    story = story_of(WORLD, [trace("uv1"), trace("uv2", ("base", "p2", "base"))], "sum")
    assert_array_equal(story.total.time_s, [0, 2, 6, 8, 14])
    assert_array_equal(story.total.value, [0, 30, 42.5, 55, 55])
    assert_array_equal(story.views[1].collected.time_s, [0, 6, 14])


def test_the_trail_leads_from_the_base_to_where_the_drive_ended() -> None:
    robot = story_of(WORLD, [trace("uv1", fails_before=2)], "trail").views[0]
    assert_array_equal(robot.trail[0, 0], [1, 1])
    assert_array_equal(robot.trail[1:, 0], robot.trail[:-1, 1])
    assert_allclose(robot.trail[-1, 1], [5, 1])
    assert_allclose(robot.trail_s[-1], 4.0)  # it waits and fails at r1: nothing is added there


def test_a_robot_that_stays_home_or_fails_at_once_is_there_all_the_same() -> None:
    story = story_of(WORLD, [trace("uv1", ()), trace("uv2", fails_before=0)], "idle")
    assert entries(story) == [(0.0, "INFO", "uv1 stays home"), (0.0, "ERROR", "uv2 failed at base, with 0 collected")]
    assert [(len(robot.trail), robot.disabled_s) for robot in story.views] == [(0, None), (0, 0.0)]
    assert story.duration_s == 0


def test_dashes_follow_the_path_round_a_corner() -> None:
    # Along x for 1, then along y for 1; dashes 0.4, gaps 0.4: [0, 0.4], [0.8, 1.2] which turns the corner, [1.6, 2].
    cut = dashes(np.array([[0, 0], [1, 0], [1, 1.0]]), 0.4, 0.4)
    expected = np.array([[[0, 0], [0.4, 0]], [[0.8, 0], [1, 0]], [[1, 0], [1, 0.2]], [[1, 0.6], [1, 1]]])
    assert_allclose(cut, expected, atol=1e-12)
    assert len(dashes(np.zeros((0, 2)), 0.4, 0.4)) == 0


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(-5, 5)), min_size=1, max_size=30))
def test_corners_draw_the_same_lines(steps: list[tuple[int, int]]) -> None:
    time, value = np.cumsum(np.array(steps, dtype=np.float64), axis=0).T
    kept = corners(time, value)
    assert kept[0]
    assert kept[-1]
    once = np.append(True, np.diff(time) > 0) & np.append(np.diff(time) > 0, True)  # where the line has one value
    assert_allclose(np.interp(time[once], time[kept], value[kept]), value[once], atol=1e-9)


@given(st.floats(1, 200), st.floats(1, 200), st.floats(-50, 50), st.floats(-50, 50))
def test_the_whole_floor_is_in_view(width: float, depth: float, x: float, y: float) -> None:
    obstacles = replace(WORLD.obstacles, bounds_m=np.array([x, y, x + width, y + depth]))
    story = story_of(replace(WORLD, obstacles=obstacles), [trace("uv1", ())], "view")
    eye, target = np.array(story.eye_m), np.array(story.target_m)
    ahead = (target - eye) / np.linalg.norm(target - eye)
    up = np.cross([1, 0, 0], ahead)
    for corner in ([x, y, 0], [x + width, y, 0], [x, y + depth, 0], [x + width, y + depth, 0]):
        ray = np.array(corner) - eye
        tall = ray @ ahead * np.tan(np.radians(55) / 2)
        assert abs(ray @ up) <= tall
        assert abs(ray[0]) <= tall * 1.55


def test_traces_of_strangers_or_twins_are_refused() -> None:
    with pytest.raises(ValueError, match="one trace per robot"):
        story_of(WORLD, [], "nobody")
    with pytest.raises(ValueError, match="one trace per robot"):
        story_of(WORLD, [trace("uv1"), trace("uv1")], "twins")
    with pytest.raises(ValueError, match="one trace per robot"):
        story_of(replace(WORLD, robots=WORLD.robots[:1]), [trace("uv2")], "stranger")


def test_news_is_logged_with_who_learned_of_it_and_what_each_robot_does_then() -> None:
    traces, news = mission_with_news()
    story = story_of(WORLD, traces, "news", news)
    told = [(entry.text, entry.color) for entry in story.log if entry.time_s == 4.0 and entry.level == "WARN"]
    assert told == [("uv2, uv3 learned that uv1 failed", ALARM),
                    ("uv2 takes over p2 and leaves out p1", VERMILLION), ("uv3 takes over p1", PURPLE)]
    assert [entry.time_s for entry in story.log] == sorted(entry.time_s for entry in story.log)
    assert (0.0, "ERROR", "uv1 failed at base, with 0 collected") in entries(story)


def test_an_orphan_changes_its_colour_to_a_light_one_of_who_takes_it_over_and_its_own_when_it_is_collected() -> None:
    traces, news = mission_with_news()
    (pois,) = (marks for marks in story_of(WORLD, traces, "news", news).marks if marks.kind == "poi")
    # News after 4 s; p1 is uv3's after 2 m from then on, p2 uv2's after 4 m, 2 s of refuelling and 2 m.
    assert_array_equal(pois.time_s, [0, 4, 6, 8])
    orphans = [pale(PURPLE), pale(VERMILLION)]
    assert_array_equal(pois.colors, [[YELLOW, YELLOW], orphans, [PURPLE, orphans[1]], [PURPLE, VERMILLION]])


def test_who_was_lost_is_marked_where_it_stands_and_in_its_lane_with_who_learned_of_it() -> None:
    traces, news = mission_with_news()
    story = story_of(WORLD, traces, "news", news)
    ((name, when, what),) = [(lost.robot, lost.time_s, lost.what) for lost in story.lost]
    assert (name, when, what) == ("uv1", 0.0, "uv1 failed at 0 s")
    assert_array_equal(story.lost[0].at_m, [1, 1])
    assert [(lane.robot, lane.height, lane.lost_s.tolist(), lane.learned_s.tolist()) for lane in story.lanes] == [
        ("uv1", 0, [0], []), ("uv2", -1, [], [4]), ("uv3", -2, [], [4])]
    assert [change.robot for change in story.changes] == ["uv2", "uv3"]
    assert_array_equal(story.changes[0].new[0], [[5, 1], [7, 1], [1, 1]])


def test_a_mission_without_news_has_neither_lanes_nor_changes() -> None:
    story = story_of(WORLD, [trace("uv1", fails_before=1)], "alone")
    assert (story.lanes, story.changes, len(story.lost)) == ((), (), 1)


def test_a_robot_that_fails_as_it_is_sent_out_from_the_base_is_logged_there() -> None:
    # uv3 had no route; sent out after 4 s, it fails at once: it never departed, and its orders hold no route.
    at_home = trace("uv3", ())
    failed = replace(at_home, outcome=replace(
        at_home.outcome, end="failed", end_time_s=4.0, events=(Event(time_s=4.0, kind="failed", site="base"),)))
    story = story_of(WORLD, [trace("uv1"), failed], "t")
    assert (4.0, "ERROR", "uv3 failed at base, with 0 collected") in entries(story)
    assert all("stays home" not in entry.text for entry in story.log)


@given(st.lists(st.tuples(st.floats(0, 4), st.floats(0, 4), st.booleans()), min_size=1, max_size=8),
       st.floats(0.3, 1.5))
@example([(0.0, y, gone) for y, gone in ((1, False), (0.5, True), (0, False), (1, True), (0, True), (2, False),
                                         (1, False), (0, False))], 0.75)
def test_names_of_robots_that_stand_together_cover_none_and_those_of_lost_ones_are_lowest(
    robots: list[tuple[float, float, bool]], step_m: float
) -> None:
    at_m, lost = [np.array([x, y]) for x, y, _ in robots], [gone for *_, gone in robots]
    raised = raised_by(at_m, lost, step_m)
    places = [at + np.array([0.0, up]) for at, up in zip(at_m, raised, strict=True)]
    for (k, one), (j, other) in itertools.combinations(enumerate(places), 2):
        dx, dy = np.abs(one - other)
        assert dx >= 2 * step_m or dy >= 0.98 * step_m, (k, j)
    first = min(range(len(robots)), key=lambda k: (not lost[k], k))
    assert raised[first] == 0.0
    for k, up in enumerate(raised):
        near = [j for j in range(len(robots)) if j != k and abs(at_m[j][0] - at_m[k][0]) < 2 * step_m]
        assert up == 0.0 or near, "a robot that stands apart has its name where it usually is"
