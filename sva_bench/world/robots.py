"""The models of a world's robots: built in, like one that is, of figures, or described in URDF."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import ValidationError

from sva_bench.errors import BadFile, nearest
from sva_bench.files.complaints import Loc, of_an_option
from sva_bench.files.documents import Document, read_bytes
from sva_bench.robot.model import BUILT_IN, RobotModel
from sva_bench.robot.own_body import WheelsExchanged, derive
from sva_bench.robot.urdf import MAX_BYTES, read_urdf
from sva_bench.world.maps.files import MapFile, locate, normal
from sva_bench.world.model import Robot, UrdfSource
from sva_bench.world.robot_schema import Figures, LikeFigures, ModelEntry, UrdfEntry

_LIMITS = ("max_speed_m_s", "max_turn_rad_s", "acceleration_m_s2", "turn_acceleration_rad_s2")
"""What a URDF doesn't say."""


def model_of(document: Document, name: str, entry: ModelEntry, root: Path) -> tuple[RobotModel, UrdfSource | None]:
    """The model of a robot, and the file that describes it.

    Models other than built-in ones are named after the robot, so that no two in a world share a name.

    Args:
        document: The world file.
        name: The robot's name.
        entry: Its ``model`` there.
        root: The folder that no file may leave.

    Raises:
        BadFile: With file, line, key and what to change.
    """
    loc: Loc = ("robots", name, "model")
    if isinstance(entry, str):
        return _built_in(document, loc, entry), None
    if isinstance(entry, UrdfEntry):
        return _described(document, loc, f"{name}-model", entry, root)
    if isinstance(entry, LikeFigures):
        given = entry.model_dump(exclude={"like"}, exclude_none=True)
        figures = _built_in(document, (*loc, "like"), entry.like).figures() | given
    else:
        figures = entry.model_dump()
    return _model(document, loc, {**figures, "name": f"{name}-model"}), None


def model_entry(robot: Robot) -> str | dict[str, Any]:
    """What stands under ``model`` in the resolved world."""
    if robot.urdf is not None:
        return dict(robot.urdf.section)
    if BUILT_IN.get(robot.model.name) == robot.model:
        return robot.model.name
    return {key: value for key, value in robot.model.figures().items() if key != "name"}


def _built_in(document: Document, loc: Loc, name: str) -> RobotModel:
    if name not in BUILT_IN:
        raise document.error(loc, f"no built-in robot {name!r}; {nearest(name, list(BUILT_IN))}")
    return BUILT_IN[name]


def _described(document: Document, loc: Loc, name: str, entry: UrdfEntry, root: Path) -> tuple[RobotModel, UrdfSource]:
    try:
        path = locate(root, entry.urdf)
        content = read_bytes(path, MAX_BYTES)
    except BadFile as error:  # about the name given in the world file, not about the robot
        raise document.error((*loc, "urdf"), f"{error.path}: {error.problem}") from None
    urdf = read_urdf(content, str(path))
    for key, joint in (("left_wheel", entry.left_wheel), ("right_wheel", entry.right_wheel)):
        if joint not in urdf.joints:
            raise document.error((*loc, key), f"{entry.urdf} has no joint {joint!r}; "
                                 f"{nearest(joint, list(urdf.joints))}")
    if entry.left_wheel == entry.right_wheel:
        raise document.error((*loc, "right_wheel"), "it is the left wheel too; name two joints")
    try:
        derived = derive(urdf, entry.left_wheel, entry.right_wheel)
    except WheelsExchanged as error:
        raise document.error((*loc, "left_wheel"), f"in {entry.urdf} {error}") from None
    figures = {"radius_m": derived.radius_m, "wheel_radius_m": derived.wheel_radius_m, "track_m": derived.track_m,
               "mass_kg": derived.body.mass_kg, **{key: getattr(entry, key) for key in _LIMITS}}
    try:
        Figures(**figures)
    except ValidationError as error:
        raise document.error((*loc, "urdf"), f"of {entry.urdf} follows {error.errors()[0]['loc'][0]}: "
                             f"{of_an_option(error)}") from None
    model = _model(document, loc, {**figures, "name": name, "body": derived.body})
    file = MapFile(name=normal(entry.urdf), content=content)
    return model, UrdfSource(section=entry.model_dump(), file=file)


def _model(document: Document, loc: Loc, figures: dict[str, Any]) -> RobotModel:
    try:
        return RobotModel(**figures)
    except ValueError as error:
        raise document.error(loc, str(error)) from None
