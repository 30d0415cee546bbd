"""Definitions of the ROS 2 messages that bags hold, as ROS 2 writes them into bags: each with those that it rests on.

Source: common_interfaces, rcl_interfaces and geometry2 of ROS 2 Humble, Jazzy and later, which agree on them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

_TIME = "int32 sec\nuint32 nanosec"
_PLAIN: Mapping[str, str] = {
    "builtin_interfaces/Time": _TIME,
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
    "geometry_msgs/PoseStamped": "std_msgs/Header header\ngeometry_msgs/Pose pose",
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation",
    "geometry_msgs/TransformStamped":
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform",
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms",
    "nav_msgs/Path": "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses",
    "std_msgs/String": "string data",
    "std_msgs/Float64": "float64 data",
    "rcl_interfaces/Log":
        "byte DEBUG=10\nbyte INFO=20\nbyte WARN=30\nbyte ERROR=40\nbyte FATAL=50\nbuiltin_interfaces/Time stamp\n"
        "uint8 level\nstring name\nstring msg\nstring file\nstring function\nuint32 line",
}
_HEADED = ("std_msgs/Header", "builtin_interfaces/Time")
_POSED = ("geometry_msgs/Pose", "geometry_msgs/Point", "geometry_msgs/Quaternion")


def _whole(name: str, *rests_on: str) -> str:
    """A definition with those that it rests on, apart by lines of equal signs."""
    parts: Sequence[str] = [_PLAIN[name], *(f"MSG: {other}\n{_PLAIN[other]}" for other in rests_on)]
    return f"\n{'=' * 80}\n".join(parts)


DEFINITIONS: Mapping[str, str] = {
    "geometry_msgs/msg/PoseStamped": _whole("geometry_msgs/PoseStamped", *_HEADED, *_POSED),
    "tf2_msgs/msg/TFMessage": _whole(
        "tf2_msgs/TFMessage", "geometry_msgs/TransformStamped", *_HEADED, "geometry_msgs/Transform",
        "geometry_msgs/Vector3", "geometry_msgs/Quaternion"),
    "nav_msgs/msg/Path": _whole("nav_msgs/Path", *_HEADED, "geometry_msgs/PoseStamped", *_POSED),
    "std_msgs/msg/String": _whole("std_msgs/String"),
    "std_msgs/msg/Float64": _whole("std_msgs/Float64"),
    "rcl_interfaces/msg/Log": _whole("rcl_interfaces/Log", "builtin_interfaces/Time"),
}
"""Messages by their names."""
