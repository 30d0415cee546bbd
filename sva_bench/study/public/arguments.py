"""Arguments of the public functions, checked as the command line checks its options."""

from __future__ import annotations

import math
import operator
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, get_args

import numpy as np

from sva_bench.choices import Departures, Interaction
from sva_bench.errors import BadInput, SvaBenchError, nearest
from sva_bench.interrupts import as_ctrl_c
from sva_bench.study.inputs import load
from sva_bench.workers.progress import OnProgress
from sva_bench.world.model import World
from sva_bench.world.variants import adapted

if TYPE_CHECKING:
    from sva_bench.travel.times import TravelTimes  # takes OMPL to load, and a world is read without it

T = TypeVar("T")

PathLike = str | os.PathLike[str]
WorldLike = World | str | os.PathLike[str]
"""A world, or its file."""


@contextmanager
def called_from_python() -> Iterator[None]:
    """Whatever happens in a call: Ctrl-C is ``KeyboardInterrupt``, and errors name arguments, not options."""
    try:
        with as_ctrl_c(SvaBenchError, ValueError):
            yield
    except BadInput as error:
        if type(error) is not BadInput:
            raise
        raise BadInput(by_argument(str(error))) from None


def by_argument(text: str) -> str:
    """The message with arguments in place of options: ``--max-trials 5`` as ``max_trials 5``."""
    return re.sub(r"(?<![\w-])--([a-z][a-z-]*)", lambda found: found[1].replace("-", "_"), text)


def integer(name: str, value: object, least: int, most: int | None = None) -> int:
    """An integer within bounds.

    Raises:
        ValueError: If it is none.
        BadInput: If it is out of bounds.
    """
    try:
        if isinstance(value, bool):
            raise TypeError
        given: Any = value
        number = operator.index(given)
    except TypeError:
        raise ValueError(f"{name}: expected an integer, found {_shown(value)}") from None
    if number < least or (most is not None and number > most):
        shown = number if number.bit_length() <= 128 else f"with {number.bit_length()} bits"  # Python prints no more
        raise BadInput(f"{name} {shown}: expected {_bounds(least, most)}")
    return number


def number(name: str, value: object, least: float, most: float | None = None) -> float:
    """A finite number within bounds.

    Raises:
        ValueError: If it is none.
        BadInput: If it is infinite, NaN or out of bounds.
    """
    try:
        if isinstance(value, bool | str | bytes):
            raise TypeError
        given: Any = value
        figure = float(given)
    except OverflowError:  # an integer beyond all floats
        figure = math.inf
    except TypeError:
        raise ValueError(f"{name}: expected a number, found {_shown(value)}") from None
    if not math.isfinite(figure) or figure < least or (most is not None and figure > most):
        raise BadInput(f"{name} {figure:.15g}: expected {_bounds(least, most)}")
    return figure


def optional(check: Callable[..., T], name: str, value: object, *bounds: float) -> T | None:
    """What ``check`` says of the value; ``None`` stays what it is."""
    return None if value is None else check(name, value, *bounds)


def flag(name: str, value: object) -> bool:
    """``True`` or ``False``.

    Raises:
        ValueError: If it is neither.
    """
    if not isinstance(value, bool):
        raise ValueError(f"{name}: expected True or False, found {_shown(value)}")
    return value


def choice(name: str, value: T, words: object) -> T:
    """One of the words of a ``Literal``.

    Raises:
        ValueError: If it is no word.
        BadInput: If it is another.
    """
    if not isinstance(value, str):
        raise ValueError(f"{name}: expected a word, found {_shown(value)}")
    if value not in (known := [str(word) for word in get_args(words)]):
        raise BadInput(f"{name} {value[:60]!r}: {nearest(value, known)}")
    return value


def chosen(words: object) -> Callable[[str, T], T]:
    """``choice`` of these words."""
    return lambda name, value: choice(name, value, words)


def path_of(name: str, value: object, what: str = "a path") -> Path:
    """A path.

    Args:
        name: The argument.
        value: Its value.
        what: What may be given, for the message: where an object may be too, that as well.

    Raises:
        ValueError: If it is none.
        BadInput: If it is empty, which would be the current folder, and mostly is a mistake; or if no file can be
            called so.
    """
    if not isinstance(value, str | os.PathLike):
        raise ValueError(f"{name}: expected {what}, found {_shown(value)}")
    path: Any = os.fspath(value)
    if not isinstance(path, str):
        raise ValueError(f"{name}: expected a path of characters, found one of bytes")
    if not path:
        raise BadInput(f"{name}: an empty path")
    if "\0" in path:
        raise BadInput(f"{name}: {path[:60]!r} holds a null character, which no path can; leave it out")
    return Path(path)


def names_of(name: str, value: object) -> list[str] | None:
    """One name or several; ``None`` stays what it is.

    Raises:
        ValueError: If these are none.
    """
    if value is None or isinstance(value, str):
        return None if value is None else [value]
    if not isinstance(value, Sequence) or not value or not all(isinstance(word, str) for word in value):
        raise ValueError(f"{name}: expected a name or a list of names, found {_shown(value)}")
    return list(value)


def is_a(name: str, value: object, form: type[T], what: str) -> T:
    """The value, if it is of this type.

    Raises:
        ValueError: If it isn't.
    """
    if not isinstance(value, form):
        raise ValueError(f"{name}: expected {what}, found {_shown(value)}")
    return value


def by_model(name: str, value: object, form: type[T], world: World, what: str) -> dict[str, T]:
    """A value for each kind of robot in the world: for each model, and where robots meet for each of them.

    Raises:
        ValueError: If these are none.
        BadInput: If one is missing.
    """
    if not isinstance(value, Mapping):
        raise ValueError(f"{name}: expected {what} by the name of the {_kind(world)}, found {_shown(value)}")
    kinds = [world.kind_of(robot) for robot in world.robots]
    for kind in kinds:
        if kind not in value:
            raise BadInput(f"{name}: nothing for the {_kind(world)} {kind} of {world.name}; make them for this world")
    return {kind: is_a(f"{name}[{kind!r}]", value[kind], form, what) for kind in kinds}


def _kind(world: World) -> str:
    return "robot" if world.meets else "robot model"


def refuse_other_world(name: str, times: TravelTimes, world: World) -> None:
    """Refuse travel times between other sites than the world's, or between sites of the same names elsewhere.

    Raises:
        BadInput: If they are.
    """
    places = np.array([(site.x_m, site.y_m) for site in world.sites])
    ends = [(0, path[0]) for path in times.paths[0][1:2] if path is not None]
    ends += [(k, path[-1]) for k, path in enumerate(times.paths[0]) if path is not None]
    if times.sites != tuple(site.name for site in world.sites) or any(
            not np.allclose(places[k], end, atol=1e-6) for k, end in ends):
        raise BadInput(f"{name}: not of the sites of {world.name}; make them for this world")


def world_given(
    value: object, scenario: object = None, margin: object = None, plan_failure: Any = None,
    execute_failure: Any = None, interaction: Any = None, departures: Any = None,
) -> tuple[World, Path | None]:
    """The world, with these settings in place of its own, and its file if it was read from one here.

    Raises:
        ValueError: If it is neither a world nor a path, or another argument is of a wrong type.
        BadFile, BadInput: If something is wrong with the file, or with a value.
    """
    names = names_of("scenario", scenario)
    share = None if margin is None else number("margin", margin, 0, 1)
    meeting = optional(chosen(Interaction), "interaction", interaction)
    leaving = optional(chosen(Departures), "departures", departures)
    if isinstance(value, World):
        return adapted(value, names, share, plan_failure, execute_failure, meeting, leaving), None
    path = path_of("world", value, "a world or the path of its file")
    return load(path, names, share, plan_failure, execute_failure, meeting, leaving), path


def progress_of(progress: OnProgress | None) -> OnProgress:
    """Whoever is told how far it is; nobody by default.

    Raises:
        ValueError: If that can't be called.
    """
    if progress is None:
        return lambda *_: None
    if not callable(progress):
        raise ValueError(f"progress: expected a function of (what, done, of), found {_shown(progress)}")
    return progress


def _bounds(least: float, most: float | None) -> str:
    low, high = (str(end) if isinstance(end, int) else f"{end:.15g}" for end in (least, 0 if most is None else most))
    return f"at least {low}" if most is None else f"{low} to {high}"


def _shown(value: object) -> str:
    kind = type(value).__name__
    text = f"{kind} {value!r}" if isinstance(value, str | int | float | bool) else kind
    return text if len(text) <= 80 else text[:77] + "..."
