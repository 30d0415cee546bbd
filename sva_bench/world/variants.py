"""Worlds with other values at some of their keys, and what those values make wrong, said of whoever asked for them."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from sva_bench.choices import FailureProcess
from sva_bench.errors import BadFile, BadInput, SvaBenchError, nearest
from sva_bench.files.documents import Document, Loc
from sva_bench.mission.failures import without_joint
from sva_bench.world.load import world_of
from sva_bench.world.model import World

Blame = Callable[[str, str], SvaBenchError]
"""Makes an error of a key that was asked for and what is wrong with it."""

_NAMED: dict[Loc, str] = {("robots",): "robot", ("sites", "stations"): "station", ("sites", "pois"): "POI",
                          ("scenarios",): "scenario"}
"""Sections whose keys are names that the file gives: to set something of one, it has to be there."""


def world_with(document: Document, values: Mapping[str, Any], blame: Blame) -> World:
    """The world of a file with other values at some dotted keys.

    Args:
        document: The world file.
        values: The values by key.
        blame: Makes the error where one of them is wrong.

    Raises:
        BadFile: If the file is wrong by itself.
        SvaBenchError: As ``blame`` makes it.
    """
    changed = document
    for key, value in values.items():
        try:
            changed = changed.changed(key, value, _NAMED)
        except BadFile as error:
            raise blame(key, f"{error.problem.removeprefix(f'{key}: ')} (in {document.path})") from None
    try:
        return world_of(changed)
    except BadFile as error:
        if not values:
            raise
        world_of(document)  # what is wrong without them is said of the file
        key = _at_fault(document, values, error)
        where = "" if error.key == _as_in_messages(key) else f"{error.key}: "
        raise blame(key, f"{where}{error.problem} (in {document.path})") from None


def _at_fault(document: Document, values: Mapping[str, Any], error: BadFile) -> str:
    """Which of the values an error comes from: one that is about the same key, else one that is wrong alone."""
    for key in values:
        told = _as_in_messages(key)
        if any(longer == shorter or longer.startswith((f"{shorter}.", f"{shorter}["))
               for longer, shorter in ((error.key, told), (told, error.key))):
            return key
    for key, value in values.items():
        try:
            world_of(document.changed(key, value))
        except BadFile:
            return key
    return list(values)[-1]


def _as_in_messages(key: str) -> str:
    """``obstacles.2.radius_m`` as ``obstacles[2].radius_m``."""
    words = key.split(".")
    return words[0] + "".join(f"[{word}]" if word.isdecimal() else f".{word}" for word in words[1:])


def option_of(key: str, values: Mapping[str, Any]) -> str:
    """A value as the command line asks for it."""
    word = json.dumps(values[key])
    return f"--set {key}={word if len(word) <= 60 else word[:57] + '...'}"



def adapted(
    world: World, scenarios: Sequence[str] | None = None, margin: float | None = None,
    plan_failure: FailureProcess | None = None, execute_failure: FailureProcess | None = None,
) -> World:
    """A world with some of its settings replaced."""
    if scenarios:
        world = replace(world, scenarios=tuple(world.scenario(name) for name in _known_scenarios(
            scenarios, [s.name for s in world.scenarios])))
    world = replace(
        world, margin=world.margin if margin is None else margin,
        plan_failure=world.plan_failure if plan_failure is None else plan_failure,
        execute_failure=world.execute_failure if execute_failure is None else execute_failure)
    correlated = [scenario.name for scenario in world.scenarios if scenario.joint is not None]
    if correlated and (other := without_joint([world.plan_failure, world.execute_failure])):
        raise BadInput(f"scenario {correlated[0]}: under {other} robots fail independently, and this scenario has a "
                       "joint distribution; choose other scenarios, or another failure process")
    return world


def _known_scenarios(names: Sequence[str], known: list[str]) -> list[str]:
    for name in names:
        if name not in known:
            raise BadInput(f"--scenario {name}: the world has no such scenario; {nearest(name, known)}")
        if names.count(name) > 1:
            raise BadInput(f"--scenario {name}: given twice; give it once")
    return list(names)
