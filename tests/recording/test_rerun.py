from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rerun.chunk import RrdReader

from sva_bench.recording.about import About
from sva_bench.recording.colors import ALARM, BLUE, DISABLED, ROBOT_COLORS, VERMILLION, YELLOW, pale
from sva_bench.recording.record import Side, record, record_pair
from sva_bench.recording.rerun import TIMELINE, end_s
from sva_bench.recording.viewer import program, verify
from tests.recording.missions import TOUR, WORLD, mission_with_news, trace


def rows(path: Path, entity: str, component: str) -> tuple[np.ndarray[Any, np.dtype[np.float64]], list[Any]]:
    """When an entity's component was set [s], and to what."""
    times, values = [], []
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        if chunk.entity_path == f"/{entity}" and TIMELINE in chunk.timeline_names and component in batch.schema.names:
            times += batch.column(TIMELINE).cast("int64").to_pylist()
            values += batch.column(component).to_pylist()
    return np.array(times) / 1e9, values


def rgb(packed: int) -> tuple[int, int, int]:
    return packed >> 24 & 255, packed >> 16 & 255, packed >> 8 & 255


@pytest.fixture(scope="module")
def tour(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recording") / "tour.rrd"
    record(path, WORLD, [trace("uv1"), trace("uv2", fails_before=2), trace("uv3", ())], title="tour")
    return path


def test_a_recording_is_complete_and_no_draft_is_left(tour: Path) -> None:
    verify(tour)
    assert [file.name for file in tour.parent.iterdir()] == ["tour.rrd"]
    assert len(RrdReader(tour).blueprints()) == 1
    assert end_s(tour) == 14.0


def test_robots_are_shown_at_the_poses_of_their_traces(tour: Path) -> None:
    expected = trace("uv2", fails_before=2)
    times, places = rows(tour, "world/robots/uv2", "Transform3D:translation")
    _, turns = rows(tour, "world/robots/uv2/hull", "Transform3D:quaternion")
    assert_allclose(times, expected.time_s, atol=1e-9)  # nanoseconds in the file
    assert_allclose(np.array(places)[:, 0, :2], expected.pose[:, :2], atol=1e-6)  # 32-bit numbers in the file
    quaternions = np.array(turns)[:, 0]
    assert_allclose(2 * np.arctan2(quaternions[:, 2], quaternions[:, 3]), expected.pose[:, 2], atol=1e-6)


def test_a_poi_changes_its_colour_when_it_is_collected(tour: Path) -> None:
    times, colors = rows(tour, "world/pois", "Cylinders3D:colors")
    assert_array_equal(times, [0, 2, 8])
    assert [[rgb(c) for c in row] for row in colors] == [[YELLOW, YELLOW], [BLUE, YELLOW], [BLUE, BLUE]]


def test_a_robot_that_failed_is_dark_from_then_on(tour: Path) -> None:
    times, colors = rows(tour, "world/robots/uv2/hull/body", "Cylinders3D:colors")
    assert_array_equal(times, [0, 6])
    assert [rgb(row[0]) for row in colors] == [ROBOT_COLORS[1], DISABLED]


def test_each_event_is_in_the_log(tour: Path) -> None:
    times, texts = rows(tour, "events", "TextLog:text")
    events = [e for t in (trace("uv1"), trace("uv2", fails_before=2)) for e in t.outcome.events]
    assert len(texts) == len(events) + 1  # uv3 stays home: a sentence without an event
    assert_array_equal(times[1:], sorted(event.time_s for event in events))
    assert ["uv2 failed at r1, with 30 collected"] in texts


def test_series_hold_fuel_and_incentive(tour: Path) -> None:
    times, values = rows(tour, "collected/total", "Scalars:scalars")
    assert_array_equal(times, [0, 2, 2, 8, 14])
    assert_array_equal(np.array(values)[:, 0], [0, 30, 60, 72.5, 72.5])
    times, values = rows(tour, "fuel/uv1", "Scalars:scalars")
    assert_allclose(np.column_stack([times, np.array(values)[:, 0]]), [[0, 20], [4, 16], [6, 20], [14, 12]], atol=1e-9)
    assert rows(tour, "fuel/uv2", "Scalars:scalars")[0][-1] == 6  # it failed
    assert not len(rows(tour, "fuel/uv3", "Scalars:scalars")[0])  # no limit


def test_robots_that_never_leave_are_recorded(tmp_path: Path) -> None:
    path = tmp_path / "idle.rrd"
    record(path, WORLD, [trace("uv1", ()), trace("uv2", fails_before=0)], title="idle")
    verify(path)
    for robot, color in (("uv1", BLUE), ("uv2", DISABLED)):
        times, places = rows(path, f"world/robots/{robot}", "Transform3D:translation")
        assert_array_equal(times, [0])
        assert_array_equal(places, [[[1, 1, 0]]])
        _, colors = rows(path, f"world/robots/{robot}/hull/body", "Cylinders3D:colors")
        assert [rgb(row[0]) for row in colors] == [color]
    # There is no mission to play, and yet lines and lanes have a length.
    assert end_s(path) == 10
    assert_array_equal(rows(path, "collected/total", "Scalars:scalars")[0], [0, 10])


def test_names_of_robots_in_one_place_are_seen_above_each_other_until_they_part(tour: Path) -> None:
    # uv2 fails and comes first; uv1 is two radii away from the base from 2 x 0.177 s on, until as long before 14 s.
    times, places = rows(tour, "world/robots/uv2/name", "Points3D:positions")
    assert_allclose(times, [0, 0.4, 6], atol=0.06)
    assert places[-1] == []  # lost: from then on it is said what happened
    ((usual,), (away,), _) = places
    assert_allclose(usual, away)
    ((said,),) = rows(tour, "world/lost/uv2/what", "Points3D:positions")[1]
    assert_allclose(said[:2], [5 + usual[0], 1 + usual[1]], atol=1e-6)
    heights = {}
    for robot, changes in (("uv1", [0, 0.4, 13.7]), ("uv3", [0])):
        times, places = rows(tour, f"world/robots/{robot}/name", "Points3D:positions")
        assert_allclose(times, changes, atol=0.06)
        heights[robot] = [place[0][1] - usual[1] for place in places]
    assert_allclose(heights["uv1"][1], 0.0, atol=1e-6)
    assert 0.2 < heights["uv1"][0] == heights["uv1"][2] == pytest.approx(heights["uv3"][0] / 2)


def test_whatever_is_written_on_a_map_is_white(told: Path, tour: Path) -> None:
    for path in (told, tour):
        written = {chunk.entity_path for chunk in RrdReader(path).stream()
                   if "Points3D:labels" in chunk.to_record_batch().schema.names}
        assert {"/world/pois/names", "/world/robots/uv1/name"} < written
        assert any(entity.endswith("/what") for entity in written)
        for entity in written:
            ((packed,),) = constants(path, entity.removeprefix("/"), "Points3D:colors")
            assert rgb(packed) == (255, 255, 255), entity


def test_a_recording_says_what_its_marks_mean_and_leaves_out_what_is_not_there(told: Path, tmp_path: Path) -> None:
    quiet = tmp_path / "quiet.rrd"
    record(quiet, WORLD, [trace("uv1")], title="quiet")
    for path, lost in ((told, True), (quiet, False)):
        ((text,),) = constants(path, "about", "TextDocument:text")
        assert "yellow: POI" in text
        assert ("red cross: lost robot" in text) is lost
        assert "red dot" not in text


def test_of_two_plans_both_lines_go_on_to_the_end_of_the_longer_one(tmp_path: Path) -> None:
    path = tmp_path / "pair.rrd"
    sides = [Side(about=About(scenario="nominal", planner=name, trial=0, seed=0, fidelity="rollout"), traces=traces,
                  routes={"uv1": TOUR}) for name, traces in (("stochastic", [trace("uv1")]),
                                                             ("deterministic", [trace("uv1", fails_before=0)]))]
    record_pair(path, WORLD, sides, title="pair")
    for name, values in (("stochastic", [0, 30, 42.5, 42.5]), ("deterministic", [0, 0, 0])):
        times, said = rows(path, f"compared/{name}", "Scalars:scalars")
        assert times[-1] == 14
        assert_array_equal(np.array(said)[:, 0], values)


def test_the_same_mission_twice_is_the_same_recording(tour: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.rrd"
    record(again, WORLD, [trace("uv3", ()), trace("uv2", fails_before=2), trace("uv1")], title="tour")
    subprocess.run([*program(), "rrd", "compare", str(tour), str(again)], check=True, capture_output=True)
    (one,), (other,) = RrdReader(tour).recordings(), RrdReader(again).recordings()
    assert one.recording_id == other.recording_id
    assert all(set(chunk.timeline_names) <= {TIMELINE} for chunk in RrdReader(tour).stream())  # no wall clock


def test_another_mission_is_another_recording(tour: Path, tmp_path: Path) -> None:
    path = tmp_path / "other.rrd"
    record(path, WORLD, [trace("uv1"), trace("uv2"), trace("uv3", ())], title="tour")
    (one,), (other,) = RrdReader(tour).recordings(), RrdReader(path).recordings()
    assert one.recording_id != other.recording_id


def test_recordings_leave_no_threads_but_those_of_their_layouts(tmp_path: Path) -> None:
    def threads() -> int:
        return len(list(Path("/proc/self/task").iterdir()))

    record(tmp_path / "first.rrd", WORLD, [trace("uv1")], title="first")
    before = threads()
    for number in range(5):
        record(tmp_path / f"{number}.rrd", WORLD, [trace("uv1")], title=f"mission {number}")
    assert threads() <= before + 5 * 2


def test_a_failed_recording_leaves_nothing_behind(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="one trace per robot"):
        record(tmp_path / "x.rrd", WORLD, [], title="nobody")
    (tmp_path / "taken.rrd").mkdir()
    with pytest.raises(OSError, match="taken"):
        record(tmp_path / "taken.rrd", WORLD, [trace("uv1")], title="taken")
    assert [file.name for file in tmp_path.iterdir()] == ["taken.rrd"]


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recording") / "told.rrd"
    traces, news = mission_with_news()
    record(path, WORLD, traces, title="told", news=news)
    verify(path)
    return path


def constants(path: Path, entity: str, component: str) -> list[Any]:
    """What an entity's component is at all times."""
    return [value for chunk in RrdReader(path).stream() if chunk.entity_path == f"/{entity}" and chunk.is_static
            for batch in [chunk.to_record_batch()] if component in batch.schema.names
            for value in batch.column(component).to_pylist()]


def test_a_lost_robot_is_crossed_out_and_named_from_then_on(told: Path, tour: Path) -> None:
    for path, robot, when, at, what in ((told, "uv1", 0, (1, 1), "uv1 failed at 0 s"), (tour, "uv2", 6, (5, 1), None)):
        times, (cross,) = rows(path, f"world/lost/{robot}", "LineStrips3D:strips")
        assert_array_equal(times, [when])
        corners = np.array(cross)[..., :2]
        assert_allclose(corners.mean(axis=(0, 1)), at, atol=1e-6)
        assert np.ptp(corners[..., 0]) > 2 * 2 * WORLD.robots[0].model.radius_m  # larger than the robot
        (colors,) = rows(path, f"world/lost/{robot}", "LineStrips3D:colors")[1]
        assert {rgb(color) for color in colors} == {ALARM}
        assert what is None or rows(path, f"world/lost/{robot}/what", "Points3D:labels")[1] == [[what]]
    assert not len(rows(told, "world/lost/uv2", "LineStrips3D:strips")[0])


def test_new_orders_are_thick_and_old_ones_thin_from_the_news_on(told: Path) -> None:
    widths = {}
    for name, route, color in (("old", [[5, 1], [3, 1], [1, 1]], pale(VERMILLION)),
                               ("new", [[5, 1], [7, 1], [1, 1]], VERMILLION)):
        entity = f"world/orders/uv2/{name}"
        times, (strips,) = rows(told, entity, "LineStrips3D:strips")
        assert_array_equal(times, [4])
        assert_allclose(np.array(strips[0])[:, :2], route, atol=1e-6)
        ((packed,),) = constants(told, entity, "LineStrips3D:colors")
        assert rgb(packed) == color
        ((radius,),) = constants(told, entity, "LineStrips3D:radii")
        widths[name] = abs(radius)  # negative: in points of the screen
    assert widths["new"] > 2 * widths["old"]
    assert not len(rows(told, "world/orders/uv3/old", "LineStrips3D:strips")[0])  # it had none


def test_lanes_show_who_was_lost_and_who_learned_of_it_when(told: Path, tour: Path) -> None:
    marks = {entity: [(when, value[0]) for when, value in zip(*rows(told, f"news/{entity}", "Scalars:scalars"),
                                                              strict=True)]
             for entity in ("uv1/lost", "uv1/learned", "uv2/learned", "uv3/learned", "uv2/lost")}
    assert marks == {"uv1/lost": [(0, 0)], "uv1/learned": [], "uv2/learned": [(4, -1)], "uv3/learned": [(4, -2)],
                     "uv2/lost": []}
    assert not any(chunk.entity_path.startswith("/news") for chunk in RrdReader(tour).stream())
