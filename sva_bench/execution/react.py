"""Plans executed by teams that react: every history of failures played, or a sample of them.

A policy decides on planned times as long as nothing was driven; the legs that its team then uses are driven, and the
missions are played again, until no leg is new.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.chance import Drawn, Histories, History
from sva_bench.execution.drives import Courses, Drives, RouteKey, drive_all
from sva_bench.execution.execute import orders_of, planned_legs
from sva_bench.execution.fate import draw_fate
from sva_bench.execution.outcome import Assignment, RobotFate
from sva_bench.execution.policies.policy import Policy
from sva_bench.execution.rules import LegDriven
from sva_bench.execution.settling import figures_of
from sva_bench.execution.team import Team, TeamOutcome, play
from sva_bench.mission.failures import PlanningTerms, process_of
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.model import World

MOST_HISTORIES = 10_000
"""Histories of a plan under all noise draws up to which they are enumerated."""

Stops = tuple[str, ...]


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
        available, incentive, lost, value, pois_reached, stops_reached, end, end_time_s, fuel_used_s, contacts: As of
            ``Executed``.
        left_over: Incentive of the POIs that a robot was still to visit when it ended, and nobody else collected.
        reacted: Whether orders changed, shape (rows,).
        doubled: POIs that two robots visited, shape (rows,).
        nominal: Value of the team if each leg is driven as planned: of each trial, or of all histories together,
            shape (rows,) or ().
        bounds: Least and greatest value of a team: all robots lost, or every POI visited by the one that earns most.
        played: The missions themselves, by row.
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
    contacts: IntArray
    left_over: FloatArray
    reacted: BoolArray
    doubled: IntArray
    nominal: FloatArray
    bounds: tuple[float, float]
    played: tuple[TeamOutcome, ...]

    @property
    def waited_s(self) -> FloatArray:
        """How long each robot waited beside its stops [s]: nobody does."""
        return np.zeros(self.incentive.shape)


@dataclass(frozen=True, kw_only=True)
class _Row:
    """A mission as it was played."""

    rollout: int
    weight: float
    history: int
    played: TeamOutcome


class _Legs:
    """Driving times of legs: as driven, or as planned where that is unknown yet."""

    def __init__(self, world: World, costs: Mapping[str, FuelCosts], settings: Settings) -> None:
        self._world, self._composed = world, settings.fidelity == "rollout"
        self._models = [robot.model.name for robot in world.robots]
        self._names = [robot.name for robot in world.robots]
        self._number = {site.name: k for k, site in enumerate(world.sites)}
        self._planned = {model: (cost.repaired_ms / 1000).tolist() for model, cost in costs.items()}
        self._scheduled = {model: cost.cost_s.tolist() for model, cost in costs.items()}
        self._driven: dict[tuple[int, int, Stops], LegDriven] = {}
        self.missing: dict[RouteKey, bool] = {}

    def scheduled_s(self, robot: int, origin: str, destination: str) -> float:
        """What the plan reckons with, margin included [s]."""
        cost_s: float = self._scheduled[self._models[robot]][self._number[origin]][self._number[destination]]
        return cost_s

    def planned(self, robot: int, stops: Stops) -> LegDriven:
        """The last leg as planned, without margin."""
        row = self._planned[self._models[robot]][self._number[stops[-2]]]
        return LegDriven(row[self._number[stops[-1]]])

    def driven(self, rollout: int) -> Callable[[int, Stops], LegDriven]:
        """The last leg as it was driven under a noise draw; what isn't known is noted in ``missing``.

        Up to ``rollout`` a leg begins at rest in its origin's own pose; else it depends on all stops before it.
        """
        def leg(robot: int, stops: Stops) -> LegDriven:
            key = stops[-2:] if self._composed else stops
            found = self._driven.get((robot, rollout, key))
            if found is None:
                self.missing[self._names[robot], key, rollout, 0] = False
                return self.planned(robot, stops)
            return found

        return leg

    def learn(self, keys: Iterable[RouteKey], drives: Drives) -> None:
        """Take in what was driven."""
        for key in keys:
            name, stops, rollout, _ = key
            robot, driven = self._names.index(name), drives.routes[key]
            last = len(driven.leg_s) - 1
            for leg, (time_s, contacts) in enumerate(zip(driven.leg_s.tolist(), driven.contacts.tolist(), strict=True)):
                self._driven[robot, rollout, stops[: leg + 2]] = LegDriven(
                    time_s, driven.stuck and leg == last, contacts)


def react(
    world: World, costs: Mapping[str, FuelCosts], cases: Sequence[Case], policies: Sequence[Policy], settings: Settings,
    executor: Executor | None = None, progress: Callable[[int, int], None] | None = None, drives: Drives | None = None,
) -> list[Reacted]:
    """Execute plans whose teams react, all histories or all trials of each.

    Histories are enumerated for all cases or for none, so that they can be compared.

    Args:
        world: The world.
        costs: Fuel costs by the name of the robot model.
        cases: Plans with their scenario, policy and news.
        policies: The policy of each case.
        settings: Seed, trials, rollouts, fidelity.
        executor: Where drives run; ``None`` = here.
        progress: Called with the number of drives done and of all.
        drives: What was driven already; what is driven now is added.
    """
    drives = Drives() if drives is None else drives
    legs, courses = _Legs(world, costs, settings), Courses(world, costs, settings)
    teams = [_team(world, costs, case, policy, legs) for case, policy in zip(cases, policies, strict=True)]
    plays = _plays(world, cases, teams, settings, legs)
    while True:
        rows = [each.rows(legs) for each in plays]
        if not legs.missing:
            break
        wanted, legs.missing = _longest(legs.missing), {}
        drive_all(courses.chunks(wanted, drives), drives, executor, progress)
        courses.compose(wanted, drives)
        legs.learn(wanted, drives)
    return [each.reacted(mine) for each, mine in zip(plays, rows, strict=True)]


def modelled_values(
    world: World, costs: Mapping[str, FuelCosts], cases: Sequence[Case], policies: Sequence[Policy], settings: Settings,
) -> list[float]:
    """Mean value of each case if every leg is driven as planned: over all histories if they are few, or over trials."""
    legs = _Legs(world, costs, settings)
    teams = [_team(world, costs, case, policy, legs) for case, policy in zip(cases, policies, strict=True)]
    return [each.modelled for each in _plays(world, cases, teams, settings, legs)]


def _plays(
    world: World, cases: Sequence[Case], teams: Sequence[Team], settings: Settings, legs: _Legs
) -> Sequence[_Enumerated | _Sampled]:
    """Cases played on planned times: all histories of each, or all trials of each."""
    enumerated = [_Enumerated(world, case, team, settings) for case, team in zip(cases, teams, strict=True)]
    if all(each.begin(legs) for each in enumerated):
        return enumerated
    sampled = [_Sampled(world, case, team, settings) for case, team in zip(cases, teams, strict=True)]
    for each in sampled:
        each.begin(legs)
    return sampled


def _longest(missing: Mapping[RouteKey, bool]) -> dict[RouteKey, bool]:
    """The routes of which no other is a longer version."""
    shorter = {(name, stops[:k], rollout, trial) for name, stops, rollout, trial in missing
               for k in range(2, len(stops))}
    return {key: traced for key, traced in missing.items() if key not in shorter}


def _team(world: World, costs: Mapping[str, FuelCosts], case: Case, policy: Policy, legs: _Legs) -> Team:
    return Team(orders=tuple(orders_of(world, case, planned_legs(world, costs, [case]))), base=world.sites[0].name,
                pois=frozenset(site.name for site in world.pois), policy=policy, news=case.news,
                scheduled_s=legs.scheduled_s)


class _Plays:
    """A case that is played."""

    def __init__(self, world: World, case: Case, team: Team, settings: Settings) -> None:
        self._world, self._case, self._team, self._settings = world, case, team, settings
        self._robots = tuple(robot.name for robot in world.robots)

    @property
    def _terms(self) -> PlanningTerms:
        process = process_of(self._world.execute_failure)
        return process.terms([self._case.scenario.reliability(robot) for robot in self._world.robots])


class _Enumerated(_Plays):
    """All histories of a case under each noise draw."""

    _nominal = 0.0

    def begin(self, legs: _Legs) -> bool:
        """Play all histories on planned times; whether they are few enough."""
        most = MOST_HISTORIES // min(self._settings.rollouts, self._settings.trials)
        self._nominal = 0.0
        for number, history in enumerate(self._histories()):
            if number >= most:
                return False
            played = play(self._team, history, legs.planned)
            self._nominal += history.weight * sum(robot.value for robot in played.robots)
        return True

    @property
    def modelled(self) -> float:
        """Expected value on planned times."""
        return self._nominal

    def _histories(self) -> Histories:
        return Histories(self._terms, self._case.scenario.joint, self._robots)

    def rows(self, legs: _Legs) -> list[_Row]:
        """All histories under each noise draw."""
        draws = min(self._settings.rollouts, self._settings.trials)
        return [_Row(rollout=rollout, weight=history.weight / draws, history=number, played=played)
                for rollout in range(draws) for number, (history, played) in enumerate(self._played(legs, rollout))]

    def _played(self, legs: _Legs, rollout: int) -> list[tuple[History, TeamOutcome]]:
        driven = legs.driven(rollout)
        return [(history, play(self._team, history, driven)) for history in self._histories()]

    def reacted(self, rows: Sequence[_Row]) -> Reacted:
        """The rows as arrays."""
        return _reacted(self._case, self._team, self._robots, rows, np.arange(len(rows)), np.array(self._nominal),
                        enumerated=True)


class _Sampled(_Plays):
    """The trials of a case; those with the same fate and noise draw are played once."""

    def __init__(self, world: World, case: Case, team: Team, settings: Settings) -> None:
        super().__init__(world, case, team, settings)
        self._fate = draw_fate(world, case.scenario, [len(world.pois)] * len(world.robots), settings)
        self._nominal = np.zeros(settings.trials)

    def _fates(self) -> list[tuple[RobotFate, ...]]:
        return [tuple(self._fate.of(row, robot) for robot in range(len(self._robots)))
                for row in range(self._settings.trials)]

    def begin(self, legs: _Legs) -> bool:
        """Play all trials on planned times."""
        known: dict[tuple[RobotFate, ...], float] = {}
        for row, fates in enumerate(self._fates()):
            if fates not in known:
                played = play(self._team, Drawn(fates), legs.planned)
                known[fates] = sum(robot.value for robot in played.robots)
            self._nominal[row] = known[fates]
        return True

    @property
    def modelled(self) -> float:
        """Mean value on planned times."""
        return float(self._nominal.mean())

    def rows(self, legs: _Legs) -> list[_Row]:
        """All trials, each under its noise draw."""
        known: dict[tuple[tuple[RobotFate, ...], int], TeamOutcome] = {}
        rows = []
        for row, fates in enumerate(self._fates()):
            rollout = int(self._fate.rollout[row])
            if (fates, rollout) not in known:
                known[fates, rollout] = play(self._team, Drawn(fates), legs.driven(rollout))
            rows.append(_Row(rollout=rollout, weight=1 / self._settings.trials, history=-1,
                             played=known[fates, rollout]))
        return rows

    def reacted(self, rows: Sequence[_Row]) -> Reacted:
        """The rows as arrays."""
        trials = self._settings.first + np.arange(len(rows))
        return _reacted(self._case, self._team, self._robots, rows, trials, self._nominal, enumerated=False)


def _reacted(
    case: Case, team: Team, robots: tuple[str, ...], rows: Sequence[_Row], trial: IntArray, nominal: FloatArray, *,
    enumerated: bool,
) -> Reacted:
    played = tuple(row.played for row in rows)
    columns = [figures_of([mission.robots[number] for mission in played]) for number in range(len(robots))]
    figures = {name: np.column_stack([column[name] for column in columns]) for name in columns[0]}
    return Reacted(
        case=case, robots=robots, enumerated=enumerated, trial=trial,
        rollout=np.array([row.rollout for row in rows], dtype=np.int64),
        history=np.array([row.history for row in rows], dtype=np.int64), weight=np.array([row.weight for row in rows]),
        available=figures["available"].astype(np.bool_), lost=figures["lost"].astype(np.bool_),
        incentive=figures["incentive"], value=figures["value"], end_time_s=figures["end_time_s"],
        fuel_used_s=figures["fuel_used_s"],
        **{name: figures[name].astype(np.int64) for name in ("pois_reached", "stops_reached", "end", "contacts")},
        left_over=np.array([[_worth(own, mission.left_over[number]) for number, own in enumerate(team.orders)]
                            for mission in played]),
        reacted=np.array([any(r.after for r in mission.reactions) for mission in played]),
        doubled=np.array([mission.doubled for mission in played], dtype=np.int64), nominal=nominal, played=played,
        bounds=(-sum(own.loss_cost for own in team.orders), sum(
            max(own.incentives.get(poi, 0.0) for own in team.orders) for poi in sorted(team.pois))))


def _worth(orders: Assignment, pois: Iterable[str]) -> float:
    return sum(orders.incentives.get(poi, 0.0) for poi in pois)
