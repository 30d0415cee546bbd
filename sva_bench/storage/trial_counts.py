"""How the trials of a run came out, counted: where robots ended, and which values trials had.

Counted from the rows of outcomes as they are written or read, so that a page can show them without holding the rows.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from sva_bench.choices import ENDS, End

Key = tuple[str, str, str, str]
"""Scenario, planner, policy and news."""

MOST_VALUES = 20_000
"""Different values of the trials of a plan that are counted one by one; of more there is no count."""
_DIGITS = 6  # of a value: sums of incentives in another order are the same value
_KEY = ("scenario", "planner", "policy", "news")


@dataclass(frozen=True, kw_only=True)
class Ended:
    """Missions of one robot that ended alike.

    Attributes:
        robot: The robot.
        end: How they ended.
        stops: How many stops of its orders it had reached.
        left: Whether it set out.
        share: Share of all missions.
    """

    robot: str
    end: End
    stops: int
    left: bool
    share: float


@dataclass(frozen=True, eq=False, kw_only=True)
class TrialCounts:
    """Counts over the trials of each plan.

    Attributes:
        ended: Where and how robots ended, of each plan and reaction, robot by robot.
        values: Values of the team in a trial, ascending, with how many trials had each, of plans without reaction;
            nothing of plans with more than ``MOST_VALUES`` of them.
    """

    ended: Mapping[Key, tuple[Ended, ...]] = field(default_factory=dict)
    values: Mapping[tuple[str, str], tuple[tuple[float, int], ...]] = field(default_factory=dict)


class Counting:
    """Counts of the rows of outcomes, piece by piece, in their order.

    Args:
        robots: How many rows a trial has.
    """

    def __init__(self, robots: int) -> None:
        self._robots = robots
        self._ended: dict[Key, Counter[tuple[str, End, int, bool]]] = {}
        self._values: dict[tuple[str, str], Counter[float] | None] = {}
        self._begun: pa.Table | None = None  # rows of a trial whose others are in the next piece

    def add(self, piece: pa.Table) -> None:
        """Count some rows, which go on where the last ones ended."""
        # A robot that fails by draw along its route is not available, and lost; one that never sets out isn't lost.
        left = piece.append_column("left", pc.or_(piece.column("available"), piece.column("lost")))
        found = left.group_by([*_KEY, "robot", "end", "stops_reached", "left"], use_threads=False).aggregate(
            [("weight", "sum")])
        for row in found.to_pylist():
            mine = self._ended.setdefault((row["scenario"], row["planner"], row["policy"], row["news"]), Counter())
            mine[row["robot"], row["end"], row["stops_reached"], row["left"]] += row["weight_sum"]
        kept = _spelt(piece.filter(pc.equal(pc.cast(piece.column("policy"), pa.string()), "none")))
        kept = kept if self._begun is None else pa.concat_tables([self._begun, kept])
        whole = kept.num_rows - kept.num_rows % self._robots
        self._begun = kept.slice(whole)
        self._add_values(kept.slice(0, whole))

    def _add_values(self, rows: pa.Table) -> None:
        found = rows.group_by(["scenario", "planner", "trial"], use_threads=False).aggregate(
            [("value", "sum"), ("value", "count")])
        for key in found.select(["scenario", "planner"]).group_by(["scenario", "planner"]).aggregate([]).to_pylist():
            plan = key["scenario"], key["planner"]
            mine = found.filter(pc.and_(pc.equal(found.column("scenario"), plan[0]),
                                        pc.equal(found.column("planner"), plan[1])))
            known = self._values.setdefault(plan, Counter())
            if known is None or not pc.all(pc.equal(mine.column("value_count"), self._robots)).as_py():
                self._values[plan] = None  # rows in another order than ours
                continue
            values, counts = np.unique(np.round(mine.column("value_sum").to_numpy(), _DIGITS) + 0.0,
                                       return_counts=True)
            known.update(dict(zip(values.tolist(), counts.tolist(), strict=True)))
            if len(known) > MOST_VALUES:
                self._values[plan] = None

    def result(self) -> TrialCounts:
        """The counts of all rows."""
        ended = {}
        for key, mine in self._ended.items():
            whole = sum(mine.values()) / self._robots
            order = sorted(mine.items(), key=lambda item: (item[0][0], ENDS.index(item[0][1]), item[0][2:]))
            ended[key] = tuple(Ended(robot=robot, end=end, stops=stops, left=left, share=round(weight / whole, _DIGITS))
                               for (robot, end, stops, left), weight in order)
        return TrialCounts(ended=ended, values={
            plan: tuple(sorted(counts.items())) for plan, counts in self._values.items() if counts is not None})


def _spelt(rows: pa.Table) -> pa.Table:
    """What values are counted by, with words spelt out: pieces have dictionaries of their own."""
    return pa.table({"scenario": pc.cast(rows.column("scenario"), pa.string()),
                     "planner": pc.cast(rows.column("planner"), pa.string()),
                     "trial": rows.column("trial"), "value": rows.column("value")})
