"""What robots met on their legs as tables: contacts and waits, written where there are any, read where they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc

from sva_bench.errors import BadFile
from sva_bench.execution.case import Case
from sva_bench.execution.executed import Executed, LegTime
from sva_bench.execution.reacted import Reacted
from sva_bench.execution.shared.players import BRAKING
from sva_bench.execution.waits import PEOPLE
from sva_bench.storage.run_folder import Legs
from sva_bench.storage.tables import CONTACTS, LEGS, MOST_ROWS, WAITS, pieces_of, write_table
from sva_bench.world.model import World

FILES: Mapping[str, pa.Schema] = {"contacts": CONTACTS, "waits": WAITS}
"""Tables of a run folder that it may lack: older ones do, and those in which nothing was met."""
MOST_MET = 5_000_000
"""Rows of either that are read, for they are held in memory."""
_LEG = tuple(name for name in LEGS.names if name in CONTACTS.names)
_FARTHEST_M = 1e6
_AGAIN = "run the command in manifest.json again"


def contact_table(executed: Sequence[Executed | Reacted]) -> pa.Table:
    """A row each time that a hull came to touch an obstacle on a leg."""
    legs = [(case, leg) for case, leg in _legs_of(executed) for _ in leg.touches]
    touches = [(leg, touch) for _, leg in _legs_of(executed) for touch in leg.touches]
    return pa.table({
        **_naming(legs), "since_s": [touch.since_s for _, touch in touches],
        "lasts_s": [touch.lasted_s for _, touch in touches], "x_m": [touch.x_m for _, touch in touches],
        "y_m": [touch.y_m for _, touch in touches], "solid": [touch.solid for _, touch in touches],
        "stuck": [leg.held_by == touch.solid and touch is leg.touches[-1] for leg, touch in touches]}, schema=CONTACTS)


def wait_table(executed: Sequence[Executed | Reacted]) -> pa.Table:
    """A row for each wait on a leg."""
    legs = [(case, leg) for case, leg in _legs_of(executed) for _ in leg.waits]
    waits = [wait for _, leg in _legs_of(executed) for wait in leg.waits]
    return pa.table({
        **_naming(legs), "since_s": [wait.since_s for wait in waits], "lasts_s": [wait.lasts_s for wait in waits],
        "x_m": [wait.x_m for wait in waits], "y_m": [wait.y_m for wait in waits],
        "cause": [wait.cause for wait in waits]}, schema=WAITS)


def _legs_of(executed: Sequence[Executed | Reacted]) -> list[tuple[Case, LegTime]]:
    """Legs on which something was met, with the case that they are of."""
    return [(run.case, leg) for run in executed for leg in run.legs if leg.touches or leg.waits]


def _naming(legs: Sequence[tuple[Case, LegTime]]) -> dict[str, Sequence[str] | Sequence[int]]:
    """The columns that name the leg of each row."""
    return {
        "scenario": [case.scenario.name for case, _ in legs], "planner": [case.planner for case, _ in legs],
        "policy": [case.policy for case, _ in legs], "news": [case.news for case, _ in legs],
        "trial": [leg.trial for _, leg in legs], "rollout": [leg.rollout for _, leg in legs],
        "robot": [leg.robot for _, leg in legs], "leg": [leg.leg for _, leg in legs],
        "origin": [leg.origin for _, leg in legs], "destination": [leg.destination for _, leg in legs]}


def write_met(folder: Path, contacts: pa.Table, waits: pa.Table) -> None:
    """Write ``contacts.parquet`` and ``waits.parquet``, those that hold anything."""
    for (name, schema), table in zip(FILES.items(), (contacts, waits), strict=True):
        if table.num_rows:
            write_table(folder / f"{name}.parquet", schema, [table])


def read_met(folder: Path, world: World, legs: Legs, words: Mapping[str, frozenset[str]]) -> tuple[pa.Table, pa.Table]:
    """Contacts and waits of a run folder; empty where it has none.

    Args:
        folder: The run folder.
        world: Its world.
        legs: Its legs: nothing is met elsewhere.
        words: What columns of words may hold.

    Raises:
        BadFile: If a table is damaged, or not of this run.
    """
    solids = ["wall", *(f"box {k + 1}" for k in range(len(world.obstacles.boxes))),
              *(f"cylinder {k + 1}" for k in range(len(world.obstacles.cylinders)))]
    sites = frozenset(site.name for site in world.sites)
    others = [robot.name for robot in world.robots] if world.meets else []
    causes = [PEOPLE, *(passage.name for passage in world.passages), *others, *([BRAKING] if world.meets else [])]
    known = {**words, "origin": sites, "destination": sites, "solid": frozenset((*solids, *others)),
             "cause": frozenset(causes)}
    contacts, waits = (_read(folder / f"{name}.parquet", schema, legs, known) for name, schema in FILES.items())
    return contacts, waits


def _read(path: Path, schema: pa.Schema, legs: Legs, words: Mapping[str, frozenset[str]]) -> pa.Table:
    if not path.exists():
        return schema.empty_table()
    pieces = []
    for piece in pieces_of(path, schema, most=min(MOST_MET, MOST_ROWS), words={
            name: held for name, held in words.items() if name in schema.names}):
        for name, least, most in (("since_s", 0.0, 1e9), ("lasts_s", 0.0, 1e9), ("x_m", -_FARTHEST_M, _FARTHEST_M),
                                  ("y_m", -_FARTHEST_M, _FARTHEST_M)):
            ends = pc.min_max(piece.column(name)).as_py()
            if piece.num_rows and not least <= ends["min"] <= ends["max"] <= most:
                raise BadFile(path, None, name, f"expected figures between {least:g} and {most:g}; {_AGAIN}")
        pieces.append(piece.cast(schema))
    found = pa.concat_tables(pieces) if pieces else schema.empty_table()
    driven = set(zip(*(getattr(legs, name) for name in _LEG), strict=True))
    for row in zip(*(found.column(name).to_pylist() for name in _LEG), strict=True):
        if row not in driven:
            raise BadFile(path, None, "leg", f"not of the legs that were driven: legs.parquet has no leg {row[7]} of "
                          f"{row[6]} from {row[8]!r} to {row[9]!r} in {row[0]}, {row[1]}, under noise draw {row[5]}; "
                          f"{_AGAIN}")
    return found
