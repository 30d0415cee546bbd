"""``manifest.json`` of a run: what was run, with what, where and how long."""

from __future__ import annotations

import platform
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field

from sva_bench import __version__
from sva_bench.analysis.results import Amount, Words
from sva_bench.choices import News, PolicyName, RecordedKind
from sva_bench.files.fields import NonNegativeInt, Seed
from sva_bench.files.records import Record
from sva_bench.files.versions import library_versions
from sva_bench.workers.pool import usable_cores

MANIFEST: Literal["sva-bench/manifest@1"] = "sva-bench/manifest@1"


def _is_text(value: object) -> object:
    if not isinstance(value, str):
        raise ValueError("expected a word")
    return value


AnyText = Annotated[Any, AfterValidator(_is_text)]
"""Text of the command line, which may not be valid UTF-8."""


@dataclass(frozen=True, kw_only=True)
class Machine(Record):
    """Where it was run."""

    platform: Words
    python: Words
    cpus: NonNegativeInt


@dataclass(frozen=True, kw_only=True)
class RecordingNote(Record):
    """What a recording of a run shows.

    Attributes:
        file: Its name in ``recordings/``.
        scenario: The scenario.
        planners: Whose plan; of a recording that compares two, both.
        trial: The trial, or the history.
        chosen: How it was chosen.
        policy, news: The reaction.
    """

    file: Words
    scenario: Words
    planners: tuple[Words, ...]
    trial: NonNegativeInt
    chosen: RecordedKind
    policy: PolicyName = "none"
    news: News = "never"


@dataclass(frozen=True, kw_only=True)
class Manifest(Record):
    """The manifest of a run; the only file with wall-clock times.

    Attributes:
        version, packages: Versions of the program, and of the libraries that results depend on.
        seed, options: The seed and all options.
        command, started, seconds: The command line, its start, and the duration of each phase [s].
        machine: Where it was run.
        world: The resolved world, which is validated as any world file.
        recordings: What the run's recordings show.
    """

    format: Literal["sva-bench/manifest@1"] = MANIFEST
    version: Words
    seed: Seed
    options: Mapping[str, Any]
    command: Annotated[tuple[AnyText, ...], Field(max_length=10_000)]
    started: Words
    seconds: Mapping[str, Amount]
    machine: Machine
    packages: Mapping[Words, Words]
    world: Mapping[str, Any]
    recordings: tuple[RecordingNote, ...] = ()


def manifest_of(world: Mapping[str, Any], seed: int, options: Mapping[str, Any], started: str,
                seconds: Mapping[str, float], command: Sequence[str] | None = None,
                recordings: Sequence[RecordingNote] = ()) -> Manifest:
    """The manifest of a run of this process; ``command``: ``None`` = its command line."""
    return Manifest(
        version=__version__, seed=seed, options=options, started=started,
        command=("sva-bench", *sys.argv[1:]) if command is None else tuple(command),
        seconds={phase: round(taken, 3) for phase, taken in seconds.items()},
        machine=Machine(platform=platform.platform(), python=platform.python_version(),
                        cpus=usable_cores()),
        packages=library_versions(), world=world, recordings=tuple(recordings))
