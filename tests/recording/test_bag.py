"""Trials as ROS 2 bags, read back by the library that others read them with."""

from __future__ import annotations

import io
import math
import sys
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from numpy.testing import assert_allclose, assert_array_equal

from sva_bench.execution.outcome import Trace
from sva_bench.recording.bag import BagRobot, NoMcap, bag_of, ros_names
from sva_bench.recording.log import log_of
from sva_bench.recording.states import state_lanes_of
from tests.recording.missions import WORLD, trace

TRACES = [trace("uv1"), trace("uv2", fails_before=2), trace("uv3", ())]
COLORS = {robot.name: (0, 0, 0) for robot in WORLD.robots}


def bag(traces: list[Trace]) -> bytes:
    robots = [BagRobot(name=t.orders.robot, time_s=t.time_s, pose=t.pose, fuel_s=t.fuel_s, planned=t.planned, lane=lane)
              for t, lane in zip(traces, state_lanes_of(traces), strict=True)]
    return bag_of(robots, log_of(traces, COLORS, ()), {"scenario": "nominal", "trial": 3})


def read(content: bytes, topic: str) -> list[tuple[float, Any]]:
    """When messages of a topic were logged [s], and what they hold."""
    reader = make_reader(io.BytesIO(content), decoder_factories=[DecoderFactory()])
    return [(message.log_time / 1e9, decoded)
            for _, _, message, decoded in reader.iter_decoded_messages(topics=[topic])]


def test_poses_are_those_of_the_trace_also_as_transforms() -> None:
    content, expected = bag(TRACES), TRACES[1]
    poses = read(content, "/uv2/pose")
    assert_allclose([time for time, _ in poses], expected.time_s, atol=1e-9)
    assert_array_equal([[m.pose.position.x, m.pose.position.y] for _, m in poses], expected.pose[:, :2])
    turned = [2 * math.atan2(m.pose.orientation.z, m.pose.orientation.w) for _, m in poses]
    assert_allclose(turned, expected.pose[:, 2], atol=1e-12)
    assert {m.header.frame_id for _, m in poses} == {"map"}
    assert_allclose([m.header.stamp.sec + m.header.stamp.nanosec / 1e9 for _, m in poses], expected.time_s, atol=1e-9)
    moved = [t for _, m in read(content, "/tf") for t in m.transforms if t.child_frame_id == "uv2/base_link"]
    assert_array_equal([[t.transform.translation.x, t.transform.translation.y] for t in moved], expected.pose[:, :2])


def test_paths_are_the_planned_one_at_the_start_and_the_driven_one_at_the_end() -> None:
    ((begun, plan),) = read(bag(TRACES), "/uv1/plan")
    assert begun == 0
    assert_array_equal([[p.pose.position.x, p.pose.position.y] for p in plan.poses], TRACES[0].planned)
    ((ended, path),) = read(bag(TRACES), "/uv1/path")
    assert ended == TRACES[0].outcome.end_time_s
    assert len(path.poses) == len(TRACES[0].time_s)
    ((_, nowhere),) = read(bag(TRACES), "/uv3/plan")  # it stays home
    assert len(nowhere.poses) == 0


def test_states_fuel_and_events_are_there() -> None:
    content = bag(TRACES)
    assert [(time, m.data) for time, m in read(content, "/uv1/state")] == [
        (0.0, "driving"), (4.0, "refuelling"), (6.0, "driving"), (14.0, "home")]
    assert [m.data for _, m in read(content, "/uv2/state")][-1] == "failed"
    fuel = read(content, "/uv1/fuel_s")
    assert_allclose([m.data for _, m in fuel], np.interp([time for time, _ in fuel], TRACES[0].time_s,
                                                         TRACES[0].fuel_s))
    assert not read(content, "/uv3/fuel_s")  # it has no limit
    said = [(time, m.level, m.msg) for time, m in read(content, "/events")]
    assert (6.0, 40, "uv2 failed at r1, with 30 collected") in said
    assert [time for time, _, _ in said] == sorted(time for time, _, _ in said)


def test_a_bag_says_what_it_is_of_and_is_the_same_each_time() -> None:
    assert bag(TRACES) == bag(TRACES)
    reader = make_reader(io.BytesIO(bag(TRACES)))
    assert reader.get_header().profile == "ros2"
    (metadata,) = reader.iter_metadata()
    assert (metadata.name, metadata.metadata) == ("mission", {"scenario": "nominal", "trial": "3"})


def test_names_become_those_that_ros_has_and_stay_apart() -> None:
    assert ros_names(["uv1", "uv-1", "uv.1", "uv_1", "2nd", "r é"]) == [
        "uv1", "uv_1", "uv_1_2", "uv_1_3", "robot_2nd", "r"]


def test_without_the_library_it_is_said_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mcap_ros2.writer", None)
    with pytest.raises(NoMcap, match=r"pip install 'sva-bench\[mcap\]'"):
        bag(TRACES)
