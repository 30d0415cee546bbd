"""Variants of worlds: other values at some keys, with errors attributed to the option or file that set them."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from sva_bench.choices import Departures, FailureProcess, Interaction
from sva_bench.errors import BadFile, BadInput, SvaBenchError, nearest
from sva_bench.files.documents import Document, Loc, places_of, value_at
from sva_bench.mission.failures import undefined_under, without_joint
from sva_bench.world.load import AMBIGUOUS, world_of
from sva_bench.world.model import World, nominal_of
from sva_bench.world.noise_schema import spelled_out

Blame = Callable[[str, str], SvaBenchError]
"""Makes the error for a key and the problem with its value."""

_NAMED: dict[Loc, str] = {("robots",): "robot", ("sites", "stations"): "station", ("sites", "pois"): "POI",
                          ("scenarios",): "scenario", ("passages",): "passage"}
"""Sections whose keys are names given in the file: values can be set below existing names only."""

_MOST_PLACES = 200  # of a key with a star: as many as there may be robots; each is a copy of the file
_RELATIVE = re.compile(r"x(\d+(?:\.\d*)?|\.\d+)")


def world_with(document: Document, values: Mapping[str, Any], blame: Blame) -> World:
    """The world of a file with other values at some dotted keys.

    Args:
        document: The world file.
        values: The values by key. A ``*`` in a key stands for all names or items there, and a value such as ``x1.2``
            for so many times the number that the file has.
        blame: Makes the error if one of them is wrong.

    Raises:
        BadFile: If the file is wrong without the values.
        SvaBenchError: From ``blame``, if a value is wrong.
    """
    changed = document
    noise = document.data.get("noise", {}) if isinstance(document.data, dict) else {}
    if not isinstance(noise, dict) and any(key.startswith("noise.") for key in values):
        changed = document.changed("noise", spelled_out(noise))
    changes: list[_Change] = []
    for key, value in values.items():
        try:
            for change in _changes(changed, key, value):
                changed = changed.changed(change.place, change.value, _NAMED)
                changes.append(change)
        except BadFile as error:
            raise blame(key, f"{error.problem.removeprefix(f'{key}: ')} (in {document.path})") from None
    try:
        return world_of(changed)
    except BadFile as error:
        if not values:
            raise
        world_of(document)  # an error without the values is the file's
        fault = _at_fault(document, changes, error)
        where = "" if error.key == _with_indices(fault.key) else f"{error.key}: "
        raise blame(fault.key, f"{where}{error.problem} (in {document.path})") from None


@dataclass(frozen=True, kw_only=True)
class _Change:
    """A value at one place of a file, and the key that it is set by, which may stand for several."""

    key: str
    place: str
    value: Any


def _changes(document: Document, key: str, value: Any) -> list[_Change]:
    """What is changed by a key and its value.

    Raises:
        BadFile: If a ``*`` stands for nothing, or a value is relative to what is no number.
    """
    places = places_of(document.data, key)
    if not places:
        raise document.error((), "there is nothing that * could stand for")
    if len(places) > _MOST_PLACES:
        raise document.error((), f"* stands for {len(places)} places; at most {_MOST_PLACES} are changed together")
    factor = _RELATIVE.fullmatch(value) if isinstance(value, str) else None
    if factor is None:
        return [_Change(key=key, place=place, value=value) for place in places]
    changes = []
    for place in places:
        base = value_at(document.data, place)
        if isinstance(base, str):  # of which x1 may be another
            changes.append(_Change(key=key, place=place, value=value))
        elif isinstance(base, bool) or not isinstance(base, int | float):
            raise document.error((), f"{value} is relative to the file, which has no number at {place}; give a number")
        else:
            product = float(f"{base * float(factor[1]):.12g}")  # without the last digits, which come of rounding
            whole = isinstance(base, int) and product.is_integer()
            changes.append(_Change(key=key, place=place, value=int(product) if whole else product))
    return changes


def _at_fault(document: Document, changes: Sequence[_Change], error: BadFile) -> _Change:
    """The change that causes an error: one that the error is about, else one that is wrong alone."""
    for change in changes:
        dotted = _with_indices(change.place)
        if any(longer == shorter or longer.startswith((f"{shorter}.", f"{shorter}["))
               for longer, shorter in ((error.key, dotted), (dotted, error.key))):
            return change
    for change in changes:
        try:
            world_of(document.changed(change.place, change.value))
        except BadFile:
            return change
    return changes[-1]


def _with_indices(key: str) -> str:
    """``obstacles.2.radius_m`` as ``obstacles[2].radius_m``."""
    words = key.split(".")
    return words[0] + "".join(f"[{word}]" if word.isdecimal() else f".{word}" for word in words[1:])


def option_of(key: str, values: Mapping[str, Any]) -> str:
    """A value as the option that sets it."""
    word = json.dumps(values[key])
    return f"--set {key}={word if len(word) <= 60 else word[:57] + '...'}"


def adapted(
    world: World, scenarios: Sequence[str] | None = None, margin: float | None = None,
    plan_failure: FailureProcess | None = None, execute_failure: FailureProcess | None = None,
    interaction: Interaction | None = None, departures: Departures | None = None,
) -> World:
    """A world with some of its settings replaced.

    Args:
        world: The world.
        scenarios: Names of the scenarios to keep; ``None`` = all.
        margin, plan_failure, execute_failure, interaction, departures: In place of the world's own; ``None`` = the
            same.

    Raises:
        BadInput: If a scenario is unknown or listed twice, or a process doesn't support its joint distribution,
            or departures are staggered of robots that nobody coordinates.
    """
    if scenarios:
        world = replace(world, scenarios=tuple(world.scenario(name) for name in _known_scenarios(
            scenarios, [s.name for s in world.scenarios])))
    world = replace(
        world, margin=world.margin if margin is None else margin,
        plan_failure=world.plan_failure if plan_failure is None else plan_failure,
        execute_failure=world.execute_failure if execute_failure is None else execute_failure,
        interaction=world.interaction if interaction is None else interaction,
        departures=world.departures if departures is None else departures)
    if world.unfit_departures:
        raise BadInput(f"{world.name}: departures can't be staggered under interaction {world.interaction}, where no "
                       "order says who waits for whom; take departures together, or interaction shared")
    if (clash := world.ambiguous_robot) is not None:
        raise BadInput(f"robots.{clash[0]}: {AMBIGUOUS.format(clash[1])}")
    correlated = [scenario.name for scenario in world.scenarios if scenario.joint is not None]
    if correlated and (other := without_joint([world.plan_failure, world.execute_failure])):
        raise BadInput(f"scenario {correlated[0]}: under {other} robots fail independently, and this scenario has a "
                       "joint distribution; choose other scenarios, or another failure process")
    for scenario in (nominal_of(world.robots), *world.scenarios):
        for robot in world.robots:
            if problem := undefined_under([world.plan_failure, world.execute_failure], scenario.reliability(robot)):
                raise BadInput(f"robots.{robot.name}, scenario {scenario.name}: {problem} of the robot")
    return world


def _known_scenarios(names: Sequence[str], known: list[str]) -> list[str]:
    for name in names:
        if name not in known:
            raise BadInput(f"--scenario {name}: the world has no such scenario; {nearest(name, known)}")
        if names.count(name) > 1:
            raise BadInput(f"--scenario {name}: given twice; give it once")
    return list(names)
