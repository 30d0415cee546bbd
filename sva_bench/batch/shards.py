"""Shards: the rows of one unit as a Parquet table, its tally in the table's metadata."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from sva_bench.batch.tallies import Tally, tally_as_dict, tally_from, tally_of
from sva_bench.errors import BadFile
from sva_bench.execution.execute import Executed, Settings
from sva_bench.execution.outcome import ENDS
from sva_bench.world.model import World

Facts = Mapping[str, Any]
"""A summary without its figures: its head, and for each scenario what is known before any trial."""

_KEY = b"sva-bench/unit"


@dataclass(frozen=True, eq=False, kw_only=True)
class Shard:
    """A unit's result.

    Attributes:
        content: The Parquet file.
        note: What its metadata say.
    """

    content: bytes
    note: Note


@dataclass(frozen=True, eq=False, kw_only=True)
class Note:
    """What a shard says of itself.

    Attributes:
        facts: What was known before any trial.
        tallies: Its trials by scenario.
        variant: What a sweep varied.
        robots: Names of the robots.
        first, trials: The range of trials.
    """

    facts: Facts
    tallies: Mapping[str, Tally]
    variant: str
    robots: Sequence[str]
    first: int
    trials: int


def shard_of(world: World, variant: str, executed: Sequence[Executed], settings: Settings, facts: Facts) -> Shard:
    """Rows and tally of trials, ready to be written."""
    robots = [robot.name for robot in world.robots]
    runs = {(run.case.scenario.name, run.case.planner): run for run in executed}
    note = Note(facts=facts, variant=variant, robots=robots, first=settings.first, trials=settings.trials, tallies={
        s.name: tally_of(runs[s.name, "stochastic"], runs[s.name, "deterministic"], noisy=not world.noise.silent)
        for s in world.scenarios})
    words = {"facts": facts, "variant": variant, "robots": robots, "first": note.first, "trials": note.trials,
             "tallies": {name: tally_as_dict(tally) for name, tally in note.tallies.items()}}
    table = pa.concat_tables([_rows(run, robots, world.name, variant, settings) for run in executed])
    table = table.replace_schema_metadata({_KEY: json.dumps(words)})
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink)
    return Shard(content=sink.getvalue().to_pybytes(), note=note)


def read_note(path: Path) -> Note:
    """What a shard says of itself.

    Raises:
        BadFile: If it is no shard of ours.
    """
    try:
        words = json.loads((pq.read_schema(path).metadata or {})[_KEY])
        return Note(facts=words["facts"], variant=words["variant"], robots=words["robots"], first=words["first"],
                    trials=words["trials"],
                    tallies={name: tally_from(data) for name, data in words["tallies"].items()})
    except (OSError, ValueError, KeyError, TypeError, pa.ArrowException) as error:
        raise BadFile(path, None, "", f"no shard of a batch ({type(error).__name__}); remove it and --resume") from None


def _rows(run: Executed, robots: Sequence[str], world: str, variant: str, settings: Settings) -> pa.Table:
    """One row per trial and robot, trial by trial; words are spelt out by Arrow, which is quick at it."""
    trials, count = run.incentive.shape
    rows = trials * count

    def constant(word: str) -> pa.Array:
        return _words(np.zeros(rows, dtype=np.int8), [word])

    units = {b"unit": b"s"}
    columns = {
        "scenario": constant(run.case.scenario.name), "planner": constant(run.case.planner),
        "trial": np.repeat(settings.first + np.arange(trials), count), "rollout": np.repeat(run.rollout, count),
        "robot": _words(np.tile(np.arange(count, dtype=np.int32), trials), robots),
        "available": run.available.ravel(), "incentive": run.incentive.ravel(),
        "pois_reached": run.pois_reached.ravel(), "stops_reached": run.stops_reached.ravel(),
        "end": _words(run.end.ravel().astype(np.int8), ENDS), "end_time_s": run.end_time_s.ravel(),
        "fuel_used_s": run.fuel_used_s.ravel(), "fidelity": constant(settings.fidelity), "world": constant(world),
        "seed": np.full(rows, settings.seed), "variant": constant(variant),
    }
    table = pa.table(columns)
    return table.cast(pa.schema([field.with_metadata(units) if field.name.endswith("_s") else field
                                 for field in table.schema]))


def _words(codes: np.ndarray[Any, Any], words: Sequence[str]) -> pa.Array:
    return pa.DictionaryArray.from_arrays(pa.array(codes), pa.array(list(words))).cast(pa.string())
