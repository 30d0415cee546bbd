"""Plans of teams that react, played: every history of failures under each noise draw, or a sample of trials."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.chance import Chance, Drawn, Histories
from sva_bench.execution.fate import draw_fate
from sva_bench.execution.known_legs import KnownLegs, Stops
from sva_bench.execution.outcome import Assignment, RobotFate
from sva_bench.execution.reacted import Reacted
from sva_bench.execution.rules import LegDriven
from sva_bench.execution.settling import FIGURES, figures_of
from sva_bench.execution.team import Team, play
from sva_bench.execution.team_outcome import TeamOutcome
from sva_bench.mission.failures import PlanningTerms, process_of
from sva_bench.world.model import World

MOST_HISTORIES = 10_000
"""Histories of a plan under all noise draws up to which they are enumerated."""

_FIGURES = ("end", *FIGURES, "left_over")


@dataclass(frozen=True, eq=False, kw_only=True)
class _Mission:
    """A mission as it was played.

    Attributes:
        figures: Those of ``_FIGURES``, robot by robot, shape (figures, robots).
        reacted, doubled: As of ``Reacted``.
        played: The mission itself, where it is kept.
    """

    figures: FloatArray
    reacted: bool
    doubled: int
    played: TeamOutcome | None


@dataclass(frozen=True, eq=False, kw_only=True)
class Rows:
    """All rows of a case; missions that are alike are there once.

    Attributes:
        missions: The missions.
        which: Which of them each row is, shape (rows,).
        rollout, history, weight: As of ``Reacted``.
    """

    missions: Sequence[_Mission]
    which: IntArray
    rollout: IntArray
    history: IntArray
    weight: FloatArray


class _Plays:
    """A case that is played."""

    def __init__(self, world: World, case: Case, team: Team, settings: Settings) -> None:
        self._world, self._case, self._team, self._settings = world, case, team, settings
        self._robots = tuple(robot.name for robot in world.robots)
        self._used: dict[tuple[int, Stops], None] = {}

    def _play(self, chance: Chance, driven: Callable[[int, Stops], LegDriven]) -> _Mission:
        """Play one mission."""
        return self._mission(play(self._team, chance, driven))

    def _mission(self, played: TeamOutcome) -> _Mission:
        """A mission's figures."""
        left = [_worth(own, pois) for own, pois in zip(self._team.orders, played.left_over, strict=True)]
        return _Mission(figures=np.array([*figures_of(played.robots).values(), left]), doubled=played.doubled,
                        reacted=played.orders_change,
                        played=played if self._settings.recorded else None)

    def _reacted(self, rows: Rows, trial: IntArray, nominal: FloatArray, *, enumerated: bool) -> Reacted:
        """Rows as arrays."""
        orders, which = self._team.orders, rows.which
        columns = np.array([mission.figures for mission in rows.missions])
        figures = {name: columns[which, k] for k, name in enumerate(_FIGURES)}
        return Reacted(
            case=self._case, robots=self._robots, enumerated=enumerated, trial=trial, rollout=rows.rollout,
            history=rows.history, weight=rows.weight, nominal=nominal,
            available=figures["available"].astype(np.bool_), lost=figures["lost"].astype(np.bool_),
            **{name: figures[name] for name in ("incentive", "value", "end_time_s", "fuel_used_s", "waited_s",
                                                   "left_over")},
            **{name: figures[name].astype(np.int64) for name in ("pois_reached", "stops_reached", "end", "contacts")},
            reacted=np.array([mission.reacted for mission in rows.missions])[which],
            doubled=np.array([mission.doubled for mission in rows.missions], dtype=np.int64)[which],
            played=tuple(m.played for m in (rows.missions[k] for k in which.tolist()) if m.played is not None),
            bounds=(-sum(own.loss_cost for own in orders), sum(
                max(own.incentives.get(poi, 0.0) for own in orders) for poi in sorted(self._team.pois))))

    @property
    def _terms(self) -> PlanningTerms:
        process = process_of(self._world.execute_failure)
        return process.terms([self._case.scenario.reliability(robot) for robot in self._world.robots])


class Enumerated(_Plays):
    """All histories of a case under each noise draw."""

    def __init__(self, world: World, case: Case, team: Team, settings: Settings,
                 rollouts: Sequence[int] | None = None) -> None:
        super().__init__(world, case, team, settings)
        self._draws = min(settings.rollouts, settings.trials)
        self._rollouts = range(self._draws) if rollouts is None else rollouts
        self._nominal = 0.0
        self._final: dict[int, list[tuple[float, _Mission]]] = {}

    def begin(self, legs: KnownLegs) -> bool:
        """Play all histories on planned times; whether they are few enough, and exact.

        A robot that waits at the base sets off the moment it is told to. Of lifetimes a history only says between which
        events one ends, so it would be told too late.
        """
        rate = self._terms.rate
        if rate is not None and rate.any() and self._team.news != "never" and not all(
                own.route for own in self._team.orders):
            return False
        most = MOST_HISTORIES // self._draws
        self._nominal, driven = 0.0, legs.noting(self._used)
        for number, history in enumerate(self._histories()):
            if number >= most:
                return False
            played = play(self._team, history, driven)
            self._nominal += history.weight * sum(robot.value for robot in played.robots)
        return True

    def want(self, legs: KnownLegs) -> None:
        """Ask for the legs that are driven if each takes as long as planned."""
        legs.want(self._used, self._rollouts)

    @property
    def modelled(self) -> float:
        """Expected value on planned times."""
        return self._nominal

    def _histories(self) -> Histories:
        return Histories(self._terms, self._case.scenario.joint, self._robots)

    def rows(self, legs: KnownLegs) -> Rows:
        """All histories under each noise draw."""
        found = [self._under(legs, rollout) for rollout in self._rollouts]
        missions = [mission for each in found for _, mission in each]
        return Rows(
            missions=missions, which=np.arange(len(missions)),
            rollout=np.repeat(self._rollouts, [len(each) for each in found]),
            history=np.concatenate([np.arange(len(each)) for each in found]),
            weight=np.array([weight / self._draws for each in found for weight, _ in each]))

    def _under(self, legs: KnownLegs, rollout: int) -> list[tuple[float, _Mission]]:
        """Probability and mission of all histories under a noise draw."""
        if rollout in self._final:
            return self._final[rollout]
        driven, misses = legs.driven(rollout), legs.misses
        found = []
        for history in self._histories():
            mission = self._play(history, driven)
            found.append((history.weight, mission))  # a history's weight is known once it is played
        if legs.misses == misses:
            self._final[rollout] = found
        return found

    def reacted(self, rows: Rows) -> Reacted:
        """The rows as arrays."""
        return self._reacted(rows, np.arange(len(rows.which)), np.array(self._nominal), enumerated=True)


class Sampled(_Plays):
    """The trials of a case; those with the same fate and noise draw are played once."""

    def __init__(self, world: World, case: Case, team: Team, settings: Settings) -> None:
        super().__init__(world, case, team, settings)
        self._fate = draw_fate(world, case.scenario, [len(world.pois)] * len(world.robots), settings)
        drawn = np.column_stack([self._fate.fails, self._fate.lifetime_s])
        _, self._first, self._fate_of = np.unique(drawn, axis=0, return_index=True, return_inverse=True)
        pairs = self._fate_of.ravel() * settings.rollouts + self._fate.rollout
        kinds, self._kind_of = np.unique(pairs, return_inverse=True)
        self._kinds = [divmod(kind, settings.rollouts) for kind in kinds.tolist()]
        self._nominal = np.zeros(settings.trials)
        self._used_by: list[dict[tuple[int, Stops], None]] = []
        self._final: dict[int, _Mission] = {}

    def _fates(self, fate: int) -> tuple[RobotFate, ...]:
        row = int(self._first[fate])
        return tuple(self._fate.of(row, robot) for robot in range(len(self._robots)))

    def _drawn(self, fate: int) -> Drawn:
        return Drawn(self._fates(fate))

    def begin(self, legs: KnownLegs) -> bool:
        """Play all trials on planned times."""
        values = np.zeros(len(self._first))
        for fate in range(len(values)):
            used: dict[tuple[int, Stops], None] = {}
            played = play(self._team, self._drawn(fate), legs.noting(used))
            values[fate] = sum(robot.value for robot in played.robots)
            self._used_by.append(used)
        self._nominal = values[self._fate_of.ravel()]
        return True

    def want(self, legs: KnownLegs) -> None:
        """Ask for the legs that are driven if each takes as long as planned."""
        for fate, rollout in self._kinds:
            legs.want(self._used_by[fate], [rollout])
        self._used_by = []

    @property
    def modelled(self) -> float:
        """Mean value on planned times."""
        return float(self._nominal.mean())

    def rows(self, legs: KnownLegs) -> Rows:
        """All trials, each under its noise draw."""
        missions = []
        for kind, (fate, rollout) in enumerate(self._kinds):
            mission, misses = self._final.get(kind), legs.misses
            if mission is None:
                mission = self._play(self._drawn(fate), legs.driven(rollout))
                if legs.misses == misses:
                    self._final[kind] = mission
            missions.append(mission)
        return self._rows(missions)

    @property
    def case(self) -> Case:
        """The case."""
        return self._case

    @property
    def team(self) -> Team:
        """Its team."""
        return self._team

    def kind_of(self, trial: int) -> int:
        """Which of the distinct missions a trial is."""
        return int(self._kind_of[trial - self._settings.first])

    @property
    def kinds(self) -> list[tuple[tuple[RobotFate, ...], int]]:
        """Fates and noise draw of each distinct mission."""
        return [(self._fates(fate), rollout) for fate, rollout in self._kinds]

    @property
    def first(self) -> list[int]:
        """Number of the first trial of each distinct mission."""
        _, rows = np.unique(self._kind_of, return_index=True)
        return [self._settings.first + row for row in rows.tolist()]

    def rows_of(self, played: Sequence[TeamOutcome]) -> Rows:
        """All trials, from what came of each distinct mission."""
        return self._rows([self._mission(mission) for mission in played])

    def _rows(self, missions: Sequence[_Mission]) -> Rows:
        trials = self._settings.trials
        return Rows(missions=missions, which=self._kind_of, rollout=self._fate.rollout,
                    history=np.full(trials, -1), weight=np.full(trials, 1 / trials))

    def reacted(self, rows: Rows) -> Reacted:
        """The rows as arrays."""
        trials = self._settings.first + np.arange(len(rows.which))
        return self._reacted(rows, trials, self._nominal, enumerated=False)


def _worth(orders: Assignment, pois: Iterable[str]) -> float:
    return sum(orders.incentives.get(poi, 0.0) for poi in pois)
