"""What came of a team that reacts, history by history or trial by trial."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.execution.case import Case
from sva_bench.execution.executed import LegTime
from sva_bench.execution.meetings import Meetings
from sva_bench.execution.team_outcome import TeamOutcome
from sva_bench.execution.team_trace import Played, TeamTrace


@dataclass(frozen=True, eq=False, kw_only=True)
class Reacted:
    """What came of one case with a policy. Arrays have a row for each history or trial, and a column for each robot.

    Attributes:
        case: Plan, scenario, policy and news.
        robots: Names of the robots, in order.
        enumerated: Whether the rows are all histories under each noise draw; else they are trials.
        trial: Number of each row, shape (rows,).
        rollout: Its noise draw, shape (rows,).
        history: Number of its history under that noise draw, -1 where they are sampled, shape (rows,).
        weight: Its probability; the rows' add up to 1, shape (rows,).
        available, incentive, lost, value, pois_reached, stops_reached, end, end_time_s, fuel_used_s, waited_s,
            contacts: As of ``Executed``.
        left_over: Incentive of the POIs that a robot was still to visit when it ended, and nobody else collected.
        reacted: Whether orders changed, shape (rows,).
        doubled: POIs that two robots visited, shape (rows,).
        nominal: Value of the team if each leg is driven as planned: of each trial, or of all histories together,
            shape (rows,) or ().
        bounds: Least and greatest value of a team: all robots lost, or every POI visited by the one that earns most.
        played: The missions themselves, by row; none unless recorded.
        legs: Every leg that was driven, once under each noise draw; none unless recorded.
        whole: Whether a typical mission ends alike if it is driven whole in physics; ``None`` where none was.
        shown: A typical mission with changed orders, over time; ``None`` without any, or unless recorded.
        meetings: What robots did to each other, by row; ``None`` where they do not meet.
    """

    case: Case
    robots: tuple[str, ...]
    enumerated: bool
    trial: IntArray
    rollout: IntArray
    history: IntArray
    weight: FloatArray
    available: BoolArray
    incentive: FloatArray
    lost: BoolArray
    value: FloatArray
    pois_reached: IntArray
    stops_reached: IntArray
    end: IntArray
    end_time_s: FloatArray
    fuel_used_s: FloatArray
    waited_s: FloatArray
    contacts: IntArray
    left_over: FloatArray
    reacted: BoolArray
    doubled: IntArray
    nominal: FloatArray
    bounds: tuple[float, float]
    played: tuple[TeamOutcome, ...]
    legs: tuple[LegTime, ...] = ()
    whole: bool | None = None
    shown: TeamTrace | None = None
    meetings: Meetings | None = None

    def row(self, number: int) -> Reacted:
        """What came of one row alone.

        Raises:
            IndexError: If there are fewer.
        """
        if not 0 <= number < len(self.trial):
            raise IndexError(number)
        alone: dict[str, Any] = {
            field.name: value[number:number + 1] for field in fields(self)
            if isinstance(value := getattr(self, field.name), np.ndarray) and value.ndim}
        met = None if self.meetings is None else self.meetings.rows(slice(number, number + 1))
        return replace(self, **alone, played=self.played[number:number + 1], legs=(), whole=None, shown=None,
                       meetings=met)

    def __repr__(self) -> str:
        """In a line: the arrays would fill many screens."""
        case, kind = self.case, "histories, all of them" if self.enumerated else "trials"
        return f"<{case.scenario.name}, {case.planner}, {case.policy} on {case.news} news: {len(self.trial)} {kind}, " \
               f"mean value {float(self.weight @ self.value.sum(axis=1)):.1f}>"


def missions_of(run: Reacted) -> list[Played]:
    """The missions of a case that reacts, each once, by its first trial and with the weight of all."""
    first: dict[int, int] = {}
    weights: dict[int, float] = {}
    for row, (played, weight) in enumerate(zip(run.played, run.weight.tolist(), strict=True)):
        first.setdefault(id(played), row)
        weights[id(played)] = weights.get(id(played), 0.0) + weight
    return [] if run.case.policy == "none" else [
        Played(case=run.case, trial=int(run.trial[row]), rollout=int(run.rollout[row]), weight=weights[number],
               outcome=run.played[row]) for number, row in first.items()]
