"""Worlds and plan files as they are asked for, from the command line or from Python; what is wrong is said of the file
and line.
"""

from __future__ import annotations

import os
import unicodedata
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from sva_bench.choices import INTERACTIONS, Departures, FailureProcess, Interaction
from sva_bench.errors import BadInput
from sva_bench.files.documents import YAML_SUFFIXES, Document, read_yaml
from sva_bench.files.mistaken import what_it_is
from sva_bench.interrupts import holding_back_ctrl_c
from sva_bench.world.load import load_world, world_of
from sva_bench.world.model import World
from sva_bench.world.variants import adapted

_LONGEST_NAME = 120
"""Bytes of a plan's name: with a scenario's before it and an ending behind it, it is a file's name, of 255 at most."""


def load(
    path: Path, scenarios: Sequence[str] | None = None, margin: float | None = None,
    plan_failure: FailureProcess | None = None, execute_failure: FailureProcess | None = None,
    interaction: Interaction | None = None, departures: Departures | None = None,
) -> World:
    """The world, as the command line changes it."""
    document = asked_with(read_yaml(path), interaction)
    return adapted(world_of(document), scenarios, margin, plan_failure, execute_failure, interaction, departures)


def asked_with(document: Document, interaction: Interaction | None) -> Document:
    """A world file with the interaction that is asked for in place of its own.

    What is wrong only under the file's own isn't wrong where another is asked for. A file that says none, or one that
    there isn't, is left as it is.
    """
    own = document.data.get("interaction") if isinstance(document.data, dict) else None
    return document.changed("interaction", interaction) if interaction and own in list(INTERACTIONS) else document


@contextmanager
def about(path: Path) -> Iterator[None]:
    """What travel says of sites and robots, said of the file and line where they stand."""
    with holding_back_ctrl_c():
        from sva_bench.travel.berths import NoRoomForBerths, NoRoomForSlots
        from sva_bench.travel.times import UnreachableSite

    try:
        yield
    except NoRoomForBerths as error:
        raise read_yaml(path).error(("sites", "base"), str(error)) from None
    except NoRoomForSlots as error:
        raise read_yaml(path).error(("sites", "stations", error.station), str(error)) from None
    except UnreachableSite as error:
        document = read_yaml(path)
        # Where nothing at all is reached, it is the base that stands badly.
        sites = load_world(path).sites
        name = "base" if len(error.destinations) == len(sites) - 1 > 1 else error.destinations[0]
        where = {"base": ("sites", "base"), "station": ("sites", "stations", name), "poi": ("sites", "pois", name)}
        # Of a site that the file doesn't name but leaves to us, the line of its section is said.
        kind = next(site.kind for site in sites if site.name == name)
        raise document.error(where[kind], str(error)) from None


def refuse_no_map(path: Path) -> None:
    """Refuse a file of ours where a map is asked for.

    Raises:
        BadFile: If it is one, and which command takes it.
    """
    if path.suffix.lower() not in YAML_SUFFIXES:
        return
    document = read_yaml(path)
    if isinstance(document.data, dict) and "format" in document.data and (known := what_it_is(document.data)):
        raise document.error((), f"expected a map, and {known}")


def by_name(paths: Sequence[Path]) -> dict[str, Path]:
    """Plan files by the names that they go by, in tables and as names of files: their stems.

    Raises:
        BadInput: If one can't be shown, is too long to be part of a file's name, or is that of another, as file
            systems that don't know capitals or ways of writing accents would say.
    """
    found: dict[str, Path] = {}
    known: dict[str, Path] = {}
    for path in paths:
        name = path.stem
        if problem := what_is_wrong_with(name):
            # A name that can't be shown isn't.
            shown = str(path) if name.isprintable() else repr(os.fsencode(path))
            raise BadInput(f"{shown}: a plan goes by the name of its file, and this one {problem}; rename it")
        plain = folded(name)
        if plain in known and _same_file(path, known[plain]):
            raise BadInput(f"{path}: this plan is given twice; name it once")
        if plain in known:
            raise BadInput(f"{path}: there is another plan named {name!r}, {known[plain]}; the names of the files must "
                           "differ, and in more than capitals")
        found[name] = known[plain] = path
    return found


def what_is_wrong_with(name: str) -> str | None:
    """Why a plan can't go by this name; ``None`` = it can."""
    if not name.isprintable():
        return "can't be shown"
    return f"is longer than {_LONGEST_NAME} bytes" if len(name.encode()) > _LONGEST_NAME else None


def folded(name: str) -> str:
    """The name as file systems see it that don't know capitals or ways of writing accents."""
    return unicodedata.normalize("NFKC", name).casefold()


def _same_file(path: Path, other: Path) -> bool:
    return path == other or (path.exists() and other.exists() and path.samefile(other))
