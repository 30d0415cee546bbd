"""Shards: the rows of one unit as a Parquet table, its tally in the table's metadata."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
from pydantic import ValidationError

from sva_bench.analysis.reaction_results import ReactionResult
from sva_bench.analysis.summaries import Facts
from sva_bench.batch.grid import Grid, Point
from sva_bench.batch.schema import StoredNote
from sva_bench.batch.tallies import Tally, stored_tally, tally_from, tally_of
from sva_bench.choices import OWN_PLANS
from sva_bench.errors import BadFile
from sva_bench.execution.case import Settings
from sva_bench.execution.executed import Executed
from sva_bench.files.complaints import dotted, first_complaint
from sva_bench.files.records import as_dict, from_dict
from sva_bench.storage.outcome_table import constant, outcome_table
from sva_bench.storage.tables import SHARDS, read_note_of, write_table
from sva_bench.study.options import reactions_of
from sva_bench.study.reacting import Reaction
from sva_bench.world.model import World

_KEY = b"sva-bench/unit"
_REMOVE = "remove it and --resume"


Reactions = Mapping[str, tuple[ReactionResult, ...]]
"""Results of each policy and kind of news, by scenario; empty where nobody reacts."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Unit:
    """A unit of a grid: a point, a seed, a range of trials, the number of noise draws, and the reactions measured."""

    point: Point
    seed: int
    first: int
    trials: int
    rollouts: int
    reactions: Sequence[Reaction]


@dataclass(frozen=True, eq=False, kw_only=True)
class Shard:
    """A unit's result.

    Attributes:
        content: The Parquet file.
        note: The note in its metadata.
    """

    content: bytes
    note: Note


@dataclass(frozen=True, eq=False, kw_only=True)
class Note:
    """The note of a shard.

    Attributes:
        facts: Modelled values, known before any trial.
        tallies: Its trials by scenario.
        variant: The varied settings.
        robots: Names of the robots.
        first, trials: The range of trials.
        reactions: What came of the point and seed with reactions; the note of the first range has it.
    """

    facts: Facts
    tallies: Mapping[str, Tally]
    variant: str
    robots: Sequence[str]
    first: int
    trials: int
    reactions: Reactions


def unit_of(grid: Grid, point: Point, seed: int, first: int) -> Unit:
    """A unit of a grid, by its first trial."""
    return Unit(point=point, seed=seed, first=first, rollouts=grid.options.rollouts,
                trials=min(grid.unit_trials, grid.options.trials - first),
                reactions=() if first else reactions_of(point.world, grid.options))


def shard_of(
    world: World, variant: str, executed: Sequence[Executed], settings: Settings, facts: Facts, reactions: Reactions
) -> Shard:
    """Rows and tally of trials, ready to be written; the rows are of the plans without reaction."""
    robots = tuple(robot.name for robot in world.robots)
    runs = {(run.case.scenario.name, run.case.planner): run for run in executed}
    note = Note(facts=facts, variant=variant, robots=robots, first=settings.first, trials=settings.trials,
                reactions=reactions, tallies={
        s.name: tally_of({name: runs[s.name, name] for name in OWN_PLANS if (s.name, name) in runs}, noisy=world.noisy)
        for s in world.scenarios})
    stored = StoredNote(
        facts=facts, variant=variant, robots=robots, first=note.first, trials=note.trials, reactions=reactions,
        tallies={name: stored_tally(tally) for name, tally in note.tallies.items()})
    sink = pa.BufferOutputStream()
    write_table(sink, SHARDS.with_metadata({_KEY: json.dumps(as_dict(stored))}),
                [pa.concat_tables([_rows(run, robots, world.name, variant, settings) for run in executed])])
    return Shard(content=sink.getvalue().to_pybytes(), note=note)


def read_note(path: Path, unit: Unit) -> Note:
    """The note in the shard of a unit.

    Raises:
        BadFile: If it is no valid shard, or of another unit.
    """
    try:
        words = json.loads(read_note_of(path, _KEY))
        note = from_dict(StoredNote, words)
    except ValidationError as error:
        loc, problem = first_complaint(words, StoredNote, error)
        raise BadFile(path, None, dotted(loc), f"{problem}, in the tally of this shard; {_REMOVE}") from None
    except (ValueError, RecursionError) as error:
        raise BadFile(path, None, "", f"no shard of a batch: its tally is no JSON ({type(error).__name__}); {_REMOVE}"
                      ) from None
    world = unit.point.world
    draws = {len(tally.difference.counts) for tally in note.tallies.values()}
    most = unit.rollouts if world.noisy else 0
    for key, found, known in (
            ("world", note.facts.world, world.name), ("seed", note.facts.seed, unit.seed),
            ("variant", note.variant, unit.point.variant), ("first", note.first, unit.first),
            ("trials", note.trials, unit.trials), ("robots", list(note.robots), [r.name for r in world.robots]),
            ("scenarios", [s.name for s in note.facts.scenarios], [s.name for s in world.scenarios]),
            ("reactions", {name: [(r.policy, r.news) for r in results] for name, results in note.reactions.items()},
             {s.name: list(unit.reactions) for s in world.scenarios if unit.reactions}),
            ("noise draws", all(0 < met <= most or met == most for met in draws), True)):
        if found != known:
            raise BadFile(path, None, key, f"the shard of another unit: expected {known!r:.60}, found {found!r:.60}; "
                          f"{_REMOVE}")
    return Note(facts=note.facts, variant=note.variant, robots=note.robots, first=note.first, trials=note.trials,
                reactions=note.reactions, tallies={name: tally_from(tally) for name, tally in note.tallies.items()})


def _rows(run: Executed, robots: Sequence[str], world: str, variant: str, settings: Settings) -> pa.Table:
    """The rows of a run's table, with world, seed and variant."""
    rows = outcome_table(run, robots, settings)
    for name, column in (("world", constant(world, len(rows))), ("seed", np.full(len(rows), settings.seed)),
                         ("variant", constant(variant, len(rows)))):
        rows = rows.append_column(SHARDS.field(name), pa.array(column))
    return rows
