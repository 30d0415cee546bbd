from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rerun.chunk import RrdReader

from sva_bench.recording.colors import BLUE, DISABLED, ROBOT_COLORS, YELLOW
from sva_bench.recording.rerun import TIMELINE, end_s, record
from sva_bench.recording.viewer import program, verify
from tests.recording.missions import WORLD, trace


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
    assert end_s(path) == 0


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


def test_a_failed_recording_leaves_nothing_behind(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="one trace per robot"):
        record(tmp_path / "x.rrd", WORLD, [], title="nobody")
    (tmp_path / "taken.rrd").mkdir()
    with pytest.raises(OSError, match="taken"):
        record(tmp_path / "taken.rrd", WORLD, [trace("uv1")], title="taken")
    assert [file.name for file in tmp_path.iterdir()] == ["taken.rrd"]
