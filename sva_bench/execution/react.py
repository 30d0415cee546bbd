"""Plans executed by teams that react: every history of failures played, or a sample of them.

A policy decides on planned times as long as nothing was driven; the legs that its team then uses are driven, and the
missions are played again, until no leg is new.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.errors import BadInput
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.chance import Chance, Drawn, Histories
from sva_bench.execution.drives import Courses, Drives, drive_all
from sva_bench.execution.execute import orders_of, planned_legs
from sva_bench.execution.fate import draw_fate
from sva_bench.execution.known_legs import KnownLegs, Stops, longest
from sva_bench.execution.outcome import Assignment
from sva_bench.execution.policies.policy import Policy
from sva_bench.execution.reacted import Reacted as Reacted
from sva_bench.execution.rules import LegDriven
from sva_bench.execution.settling import FIGURES, figures_of
from sva_bench.execution.team import Team, play
from sva_bench.execution.team_outcome import TeamOutcome
from sva_bench.execution.team_trace import Played, legs_used, trace_teams, typical
from sva_bench.execution.whole import WholeDrives
from sva_bench.files.printable import counted
from sva_bench.mission.failures import PlanningTerms, process_of
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.model import World

MOST_HISTORIES = 10_000
"""Histories of a plan under all noise draws up to which they are enumerated."""

MOST_TRIALS_HELD = 20_000_000
"""Robots' missions of all cases that are sampled, at some 150 bytes each."""

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
class _Rows:
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


def react(
    world: World, costs: Mapping[str, FuelCosts], cases: Sequence[Case], policies: Sequence[Policy], settings: Settings,
    executor: Executor | None = None, progress: Callable[[int, int], None] | None = None, drives: Drives | None = None,
) -> list[Reacted]:
    """Execute plans whose teams react, all histories or all trials of each.

    Histories are enumerated for all cases or for none, so that they can be compared. Missions are played again only as
    long as legs of them are unknown.

    Args:
        world: The world.
        costs: Fuel costs by the name of the robot model.
        cases: Plans with their scenario, policy and news.
        policies: The policy of each case.
        settings: Seed, trials, rollouts, fidelity.
        executor: Where drives run; ``None`` = here.
        progress: Called with the number of drives done and of all.
        drives: What was driven already; what is driven now is added.

    Raises:
        BadInput: If there are more trials to be sampled than fit in memory.
    """
    drives = Drives() if drives is None else drives
    legs = KnownLegs(world, costs, settings)
    teams = [_team(world, costs, case, policy, legs) for case, policy in zip(cases, policies, strict=True)]
    plays = _plays(world, cases, teams, settings, legs)
    rows = _driven(plays, legs, Courses(world, costs, settings), executor, progress, drives)
    reacted = [each.reacted(mine) for each, mine in zip(plays, rows, strict=True)]
    if not settings.recorded:
        return reacted
    if settings.fidelity == "rollout":
        reacted = _driven_whole(reacted, teams, WholeDrives(world, costs, settings, executor))
    return _recorded(world, costs, settings, reacted, legs, executor, drives)


def react_again(
    world: World, costs: Mapping[str, FuelCosts], case: Case, policy: Policy, settings: Settings, trial: int,
    history: tuple[int, int] | None, executor: Executor | None = None,
) -> Reacted:
    """One row of what ``react`` gave for a case, played again, and over time.

    Args:
        world, costs, case, policy, settings: As for ``react``.
        trial: Number of the row.
        history: Its noise draw and the number of its history there; ``None`` = it was sampled.
        executor: Where drives run; ``None`` = here.

    Raises:
        IndexError: If there is no such history.
    """
    legs = KnownLegs(world, costs, settings)
    team = _team(world, costs, case, policy, legs)
    play_again: _Enumerated | _Sampled
    if history is None:
        play_again = _Sampled(world, case, team, replace(settings, first=trial, trials=1))
    else:
        play_again = _Enumerated(world, case, team, settings, [history[0]])
    play_again.begin(legs)
    drives = Drives()
    (rows,) = _driven([play_again], legs, Courses(world, costs, settings), executor, None, drives)
    row = replace(play_again.reacted(rows).row(0 if history is None else history[1]), trial=np.array([trial]))
    (mission,) = _missions_of(row)
    (shown,) = trace_teams(world, costs, settings, [mission], executor, drives)
    return replace(row, legs=tuple(legs_used(row.robots, [mission], legs)), shown=shown)


def _driven(
    plays: Sequence[_Enumerated | _Sampled], legs: KnownLegs, courses: Courses, executor: Executor | None,
    progress: Callable[[int, int], None] | None, drives: Drives,
) -> list[_Rows]:
    """All rows of some plays, once each leg in them was driven."""
    for each in plays:
        each.want(legs)
    rows: list[_Rows] = []
    while legs.missing or not rows:
        wanted, legs.missing = longest(legs.missing), {}
        drive_all(courses.chunks(wanted, drives), drives, executor, progress)
        courses.compose(wanted, drives)
        legs.learn(wanted, drives)
        rows = [each.rows(legs) for each in plays]
    return rows


def _recorded(
    world: World, costs: Mapping[str, FuelCosts], settings: Settings, reacted: Sequence[Reacted], legs: KnownLegs,
    executor: Executor | None, drives: Drives,
) -> list[Reacted]:
    """What came of cases, with the legs driven, and with a typical mission over time where one reacts."""
    missions = [_missions_of(run) for run in reacted]
    chosen = [typical(mine) for mine in missions]
    traced = iter(trace_teams(world, costs, settings, [one for one in chosen if one is not None], executor, drives))
    return [replace(run, legs=tuple(legs_used(run.robots, mine, legs)), shown=None if one is None else next(traced))
            for run, mine, one in zip(reacted, missions, chosen, strict=True)]


def _driven_whole(reacted: Sequence[Reacted], teams: Sequence[Team], drives: WholeDrives) -> list[Reacted]:
    """Drive the most probable mission with changed orders under each policy and news whole, and compare."""
    chosen: dict[tuple[str, str], tuple[int, Played]] = {}
    for number, run in enumerate(reacted):
        mission, pair = typical(_missions_of(run)), (run.case.policy, run.case.news)
        if mission is not None and (pair not in chosen or mission.weight > chosen[pair][1].weight):
            chosen[pair] = number, mission
    alike = {number: drives.ends_alike(teams[number], mission.outcome, mission.rollout)
             for number, mission in chosen.values()}
    return [replace(run, whole=alike.get(number)) for number, run in enumerate(reacted)]


def _missions_of(run: Reacted) -> list[Played]:
    """The missions of a case that reacts, each once, by its first trial and with the weight of all."""
    first: dict[int, int] = {}
    weights: dict[int, float] = {}
    for row, (played, weight) in enumerate(zip(run.played, run.weight.tolist(), strict=True)):
        first.setdefault(id(played), row)
        weights[id(played)] = weights.get(id(played), 0.0) + weight
    return [] if run.case.policy == "none" else [
        Played(case=run.case, trial=int(run.trial[row]), rollout=int(run.rollout[row]), weight=weights[number],
               outcome=run.played[row]) for number, row in first.items()]


def modelled_values(
    world: World, costs: Mapping[str, FuelCosts], cases: Sequence[Case], policies: Sequence[Policy], settings: Settings,
) -> list[float]:
    """Mean value of each case if every leg is driven as planned: over all histories if they are few, or over trials."""
    legs = KnownLegs(world, costs, settings)
    teams = [_team(world, costs, case, policy, legs) for case, policy in zip(cases, policies, strict=True)]
    return [each.modelled for each in _plays(world, cases, teams, settings, legs)]


def _plays(
    world: World, cases: Sequence[Case], teams: Sequence[Team], settings: Settings, legs: KnownLegs
) -> Sequence[_Enumerated | _Sampled]:
    """Cases played on planned times: all histories of each, or all trials of each."""
    enumerated = [_Enumerated(world, case, team, settings) for case, team in zip(cases, teams, strict=True)]
    if all(each.begin(legs) for each in enumerated):
        return enumerated
    held = settings.trials * len(world.robots) * len(cases)
    if held > MOST_TRIALS_HELD:
        most = MOST_TRIALS_HELD // (len(world.robots) * len(cases))
        raise BadInput(f"{counted(settings.trials, 'trial')} of {counted(len(cases), 'plan')} with and without "
                       f"reaction: the histories of {world.name} are too many to go through all, and at most "
                       f"{counted(most, 'trial')} can be sampled (--trials), or more of fewer reactions (--policy, "
                       "--news)")
    sampled = [_Sampled(world, case, team, settings) for case, team in zip(cases, teams, strict=True)]
    for each in sampled:
        each.begin(legs)
    return sampled


def _team(world: World, costs: Mapping[str, FuelCosts], case: Case, policy: Policy, legs: KnownLegs) -> Team:
    return Team(orders=tuple(orders_of(world, case, planned_legs(world, costs, [case]))), base=world.sites[0].name,
                pois=frozenset(site.name for site in world.pois), policy=policy, news=case.news,
                scheduled_s=legs.scheduled_s)


class _Plays:
    """A case that is played."""

    def __init__(self, world: World, case: Case, team: Team, settings: Settings) -> None:
        self._world, self._case, self._team, self._settings = world, case, team, settings
        self._robots = tuple(robot.name for robot in world.robots)
        self._used: dict[tuple[int, Stops], None] = {}

    def _play(self, chance: Chance, driven: Callable[[int, Stops], LegDriven]) -> _Mission:
        """Play one mission."""
        played = play(self._team, chance, driven)
        left = [_worth(own, pois) for own, pois in zip(self._team.orders, played.left_over, strict=True)]
        return _Mission(figures=np.array([*figures_of(played.robots).values(), left]), doubled=played.doubled,
                        reacted=played.orders_change,
                        played=played if self._settings.recorded else None)

    def _reacted(self, rows: _Rows, trial: IntArray, nominal: FloatArray, *, enumerated: bool) -> Reacted:
        """Rows as arrays."""
        orders, which = self._team.orders, rows.which
        columns = np.array([mission.figures for mission in rows.missions])
        figures = {name: columns[which, k] for k, name in enumerate(_FIGURES)}
        return Reacted(
            case=self._case, robots=self._robots, enumerated=enumerated, trial=trial, rollout=rows.rollout,
            history=rows.history, weight=rows.weight, nominal=nominal,
            available=figures["available"].astype(np.bool_), lost=figures["lost"].astype(np.bool_),
            **{name: figures[name] for name in ("incentive", "value", "end_time_s", "fuel_used_s", "left_over")},
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


class _Enumerated(_Plays):
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

    def rows(self, legs: KnownLegs) -> _Rows:
        """All histories under each noise draw."""
        found = [self._under(legs, rollout) for rollout in self._rollouts]
        missions = [mission for each in found for _, mission in each]
        return _Rows(
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

    def reacted(self, rows: _Rows) -> Reacted:
        """The rows as arrays."""
        return self._reacted(rows, np.arange(len(rows.which)), np.array(self._nominal), enumerated=True)


class _Sampled(_Plays):
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

    def _drawn(self, fate: int) -> Drawn:
        row = int(self._first[fate])
        return Drawn([self._fate.of(row, robot) for robot in range(len(self._robots))])

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

    def rows(self, legs: KnownLegs) -> _Rows:
        """All trials, each under its noise draw."""
        missions = []
        for kind, (fate, rollout) in enumerate(self._kinds):
            mission, misses = self._final.get(kind), legs.misses
            if mission is None:
                mission = self._play(self._drawn(fate), legs.driven(rollout))
                if legs.misses == misses:
                    self._final[kind] = mission
            missions.append(mission)
        trials = self._settings.trials
        return _Rows(missions=missions, which=self._kind_of, rollout=self._fate.rollout,
                     history=np.full(trials, -1), weight=np.full(trials, 1 / trials))

    def reacted(self, rows: _Rows) -> Reacted:
        """The rows as arrays."""
        trials = self._settings.first + np.arange(len(rows.which))
        return self._reacted(rows, trials, self._nominal, enumerated=False)


def _worth(orders: Assignment, pois: Iterable[str]) -> float:
    return sum(orders.incentives.get(poi, 0.0) for poi in pois)
