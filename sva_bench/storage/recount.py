"""Figures of plans counted again from ``outcomes.parquet``."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc

from sva_bench.storage.agreement import Key
from sva_bench.storage.tables import OUTCOMES, pieces_of


@dataclass(frozen=True, kw_only=True)
class Recount:
    """What outcomes say of one plan.

    Attributes:
        by_robot: Mean value of each robot, weighted where histories are enumerated.
        ends: How many rows end in each way.
    """

    by_robot: Mapping[str, float]
    ends: Mapping[str, int]

    @property
    def mean(self) -> float:
        """Mean value of the team."""
        return sum(self.by_robot.values())


def recount(path: Path) -> dict[Key, Recount]:
    """The figures of each plan and reaction.

    Raises:
        BadFile: If the table can't be read.
    """
    values: dict[Key, Counter[str]] = defaultdict(Counter)
    weights: dict[Key, Counter[str]] = defaultdict(Counter)
    ends: dict[Key, Counter[str]] = defaultdict(Counter)
    for piece in pieces_of(path, OUTCOMES):
        weighted = pc.multiply(piece.column("weight"), piece.column("value"))
        groups = piece.append_column("weighted", weighted).group_by(
            ["scenario", "planner", "policy", "news", "robot", "end"]).aggregate(
            [("weighted", "sum"), ("weight", "sum"), ("weight", "count")])
        for row in _spelt_out(groups).to_pylist():
            key = row["scenario"], row["planner"], row["policy"], row["news"]
            values[key][row["robot"]] += row["weighted_sum"]
            weights[key][row["robot"]] += row["weight_sum"]
            ends[key][row["end"]] += row["weight_count"]
    return {key: Recount(ends=dict(ends[key]), by_robot={
        robot: value / weights[key][robot] for robot, value in values[key].items()}) for key in values}


def _spelt_out(table: pa.Table) -> pa.Table:
    """A table with words in place of their numbers."""
    return pa.table({name: pc.cast(table.column(name), pa.string())
                     if pa.types.is_dictionary(table.column(name).type) else table.column(name)
                     for name in table.column_names})
