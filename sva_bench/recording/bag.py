"""A trial as a ROS 2 bag (MCAP), which needs no ROS to be written. The only importer of mcap, an optional extra."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.errors import ExitCode, SvaBenchError
from sva_bench.recording.bag_messages import DEFINITIONS
from sva_bench.recording.log import Level, LogEntry
from sva_bench.recording.states import StateLane

MAP_FRAME = "map"
_LEVELS: Mapping[Level, int] = {"DEBUG": 10, "INFO": 20, "WARN": 30, "ERROR": 40}  # of rcl_interfaces/msg/Log
_FUEL_STEP_S = 1.0


class NoMcap(SvaBenchError):
    """The library that writes bags is not installed."""

    exit_code = ExitCode.FAULT  # of the installation

    def __init__(self) -> None:
        super().__init__()

    def __str__(self) -> str:
        return "--to mcap: the library that writes bags isn't installed; pip install 'sva-bench[mcap]'"


@dataclass(frozen=True, eq=False, kw_only=True)
class BagRobot:
    """What a bag holds of one robot.

    Attributes:
        name: Its name.
        time_s: Mission clock of the poses, shape (n,).
        pose: x, y [m], yaw [rad], shape (n, 3).
        fuel_s: Fuel left [s of driving], shape (n,); ``inf`` without a limit.
        planned: The path that was planned [m], shape (k, 2).
        lane: What it does when.
    """

    name: str
    time_s: FloatArray
    pose: FloatArray
    fuel_s: FloatArray
    planned: FloatArray
    lane: StateLane


@dataclass(frozen=True, kw_only=True)
class _Message:
    time_s: float
    topic: str
    kind: str
    content: dict[str, Any]


def bag_of(robots: Sequence[BagRobot], log: Sequence[LogEntry], properties: Mapping[str, str | int | float]) -> bytes:
    """The content of a bag: poses, planned and driven paths, states and fuel of each robot, and what happened.

    Times are those of the mission clock, from 0.

    Args:
        robots: The robots.
        log: What happened.
        properties: What the trial is of; they become metadata.

    Raises:
        NoMcap: If the library isn't installed.
    """
    try:
        from mcap_ros2.writer import Writer  # optional
    except ImportError:
        raise NoMcap from None
    messages = [_Message(time_s=entry.time_s, topic="/events", kind="rcl_interfaces/msg/Log", content={
        "stamp": _stamp(entry.time_s), "level": _LEVELS[entry.level], "name": "sva_bench", "msg": entry.text,
        "file": "", "function": "", "line": 0}) for entry in log]
    for robot, name in zip(robots, ros_names([robot.name for robot in robots]), strict=True):
        messages += _of_robot(robot, name)
    stream = io.BytesIO()
    writer = Writer(stream)
    schemas = {kind: writer.register_msgdef(kind, DEFINITIONS[kind]) for kind in DEFINITIONS}
    for number, message in enumerate(sorted(messages, key=lambda m: (m.time_s, m.topic))):
        writer.write_message(message.topic, schemas[message.kind], message.content, log_time=_nanoseconds(
            message.time_s), sequence=number)
    writer.add_metadata("mission", {key: str(value) for key, value in properties.items()})
    writer.finish()
    return stream.getvalue()


def ros_names(names: Sequence[str]) -> list[str]:
    """Names as ROS has them in topics and frames: letters, digits and underscores, no digit first, each another."""
    found: list[str] = []
    for name in names:
        plain = re.sub("[^A-Za-z0-9]+", "_", name).strip("_") or "robot"
        plain = f"robot_{plain}" if plain[0].isdigit() else plain
        unique, number = plain, 2
        while unique in found:
            unique, number = f"{plain}_{number}", number + 1
        found.append(unique)
    return found


def _of_robot(robot: BagRobot, name: str) -> list[_Message]:
    times = robot.time_s.tolist()
    poses = [_pose(*row) for row in robot.pose.tolist()]
    found = [_Message(time_s=0.0, topic=f"/{name}/plan", kind="nav_msgs/msg/Path", content={
        "header": _header(0.0), "poses": [{"header": _header(0.0), "pose": _pose(x, y, yaw)} for x, y, yaw in _headed(
            robot.planned).tolist()]})]
    for time_s, pose in zip(times, poses, strict=True):
        found.append(_Message(time_s=time_s, topic=f"/{name}/pose", kind="geometry_msgs/msg/PoseStamped",
                              content={"header": _header(time_s), "pose": pose}))
        found.append(_Message(time_s=time_s, topic="/tf", kind="tf2_msgs/msg/TFMessage", content={"transforms": [{
            "header": _header(time_s), "child_frame_id": f"{name}/base_link", "transform": {
                "translation": pose["position"], "rotation": pose["orientation"]}}]}))
    found.append(_Message(time_s=times[-1], topic=f"/{name}/path", kind="nav_msgs/msg/Path", content={
        "header": _header(times[-1]), "poses": [{"header": _header(time_s), "pose": pose}
                                                for time_s, pose in zip(times, poses, strict=True)]}))
    found += [_Message(time_s=time_s, topic=f"/{name}/state", kind="std_msgs/msg/String", content={"data": state})
              for time_s, state in zip(robot.lane.time_s.tolist(), robot.lane.states, strict=True)]
    if np.isfinite(robot.fuel_s).all():
        when = np.append(np.arange(0.0, times[-1], _FUEL_STEP_S), times[-1])
        left = np.interp(when, robot.time_s, robot.fuel_s)
        found += [_Message(time_s=time_s, topic=f"/{name}/fuel_s", kind="std_msgs/msg/Float64", content={"data": fuel})
                  for time_s, fuel in zip(when.tolist(), left.tolist(), strict=True)]
    return found


def _headed(path: FloatArray) -> FloatArray:
    """The points of a path, each in the direction of the stretch after it: x, y, yaw, shape (k, 3)."""
    if not len(path):
        return np.zeros((0, 3))
    steps = np.diff(path, axis=0)
    yaw = np.arctan2(steps[:, 1], steps[:, 0])
    return np.column_stack([path, np.append(yaw, yaw[-1:]) if len(yaw) else np.zeros(1)])


def _pose(x: float, y: float, yaw: float) -> dict[str, Any]:
    return {"position": {"x": x, "y": y, "z": 0.0},
            "orientation": {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}}


def _nanoseconds(time_s: float) -> int:
    return round(time_s * 1e9)


def _stamp(time_s: float) -> dict[str, int]:
    seconds, rest = divmod(_nanoseconds(time_s), 1_000_000_000)
    return {"sec": seconds, "nanosec": rest}


def _header(time_s: float) -> dict[str, Any]:
    return {"stamp": _stamp(time_s), "frame_id": MAP_FRAME}
