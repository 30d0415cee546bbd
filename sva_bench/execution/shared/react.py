"""Plans of robots that share a world executed by teams that react: each distinct mission of the trials once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace

from sva_bench.execution.case import Settings
from sva_bench.execution.executed import LegTime
from sva_bench.execution.known_legs import KnownLegs
from sva_bench.execution.known_team import Team
from sva_bench.execution.noise import draw_noise
from sva_bench.execution.outcome import RobotFate
from sva_bench.execution.plays import Sampled
from sva_bench.execution.reacted import Reacted, missions_of
from sva_bench.execution.shared.execute import Ground, Wanted, ground_of, meetings_of, play_all, ways_of
from sva_bench.execution.shared.own_ways import Ways
from sva_bench.execution.shared.players import MissionKey, TeamDriven
from sva_bench.execution.shared.trace import leg_times, traces_of
from sva_bench.execution.shared.truncation import cut_off
from sva_bench.execution.team_outcome import TeamOutcome
from sva_bench.execution.team_trace import TeamTrace, news_of, typical
from sva_bench.mission.failures import NEVER
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.model import World

_SPARE_S = 1.0  # of driving, by which a lifetime outlasts what a robot drives for sure


def react_team(
    world: World, costs: Mapping[str, FuelCosts], plays: Sequence[Sampled], settings: Settings, legs: KnownLegs,
    executor: Executor | None, progress: Callable[[int, int], None] | None, known: dict[MissionKey, TeamDriven],
) -> list[Reacted]:
    """Execute plans whose teams react over all trials, as ``react`` does for robots that don't meet.

    Args:
        world, costs, settings, executor, progress: As of ``react``.
        plays: The trials of each case.
        legs: Planned times of legs.
        known: Missions played already; what is played now is added.
    """
    ground = ground_of(world, costs)
    cases = [_Case(ways_of(ground), each) for each in plays]
    for each in plays:
        each.begin(legs)
    play_all(world, ground, settings, [one for case in cases for one in case.unfailed()], executor, progress, known)
    play_all(world, ground, settings, [one for case in cases for one in case.failed(known)], executor, progress, known)
    found = []
    for case in cases:
        missions = [case.mission(key, known) for key in case.keys]
        told = [case.told(key, mission) for key, mission in zip(case.keys, missions, strict=True)]
        rows = case.plays.rows_of(told)
        run = replace(case.plays.reacted(rows), meetings=meetings_of(missions).rows(rows.which))
        if settings.recorded and case.reacts:
            run = replace(run, legs=_legs(world, costs, case, missions),
                          shown=_shown(world, costs, ground, settings, case, run, executor, known))
        found.append(run)
    return found


def react_team_again(
    world: World, costs: Mapping[str, FuelCosts], play: Sampled, settings: Settings, legs: KnownLegs,
    executor: Executor | None,
) -> Reacted:
    """One trial of what ``react_team`` gave for a case, played again, and over time.

    Args:
        world, costs, executor: As of ``react``.
        play: The trial.
        settings: As of this trial alone.
        legs: Planned times of legs.
    """
    known: dict[MissionKey, TeamDriven] = {}
    (run,) = react_team(world, costs, [play], replace(settings, recorded=False), legs, executor, None, known)
    ground = ground_of(world, costs)
    case = _Case(ways_of(ground), play)
    (key,) = case.keys
    mission = _traced(world, ground, settings, case, key, executor, known)
    return replace(run, played=(case.told(key, mission),), legs=_legs(world, costs, case, [mission]),
                   shown=_trace(world, costs, settings, case, key, mission, settings.first))


class _Case:
    """The distinct missions of one case.

    Attributes:
        plays: Its trials.
        team: Its team.
        reacts: Whether that reacts.
        keys: The missions.
    """

    def __init__(self, ways: Ways, plays: Sampled) -> None:
        self.plays, self.team, self.ways = plays, plays.team, ways
        case = plays.case
        self.reacts = case.policy != "none"
        reaction = (case.scenario.name, case.policy, case.news) if self.reacts else None
        routes = tuple(own.route for own in self.team.orders)
        self.keys = [MissionKey(routes, fates if self.reacts else self._on_route(fates), rollout, reaction)
                     for fates, rollout in plays.kinds]

    def unfailed(self) -> list[Wanted]:
        """The missions in which nobody fails on the way."""
        return [self.wanted(key) for key in dict.fromkeys(key.unfailed for key in self.keys)]

    def failed(self, known: Mapping[MissionKey, TeamDriven]) -> list[Wanted]:
        """Missions that failures on the way make another than they'd be without."""
        return [self.wanted(key) for key in self.keys if self._found(key, known) is None]

    def mission(self, key: MissionKey, known: Mapping[MissionKey, TeamDriven]) -> TeamDriven:
        """What came of a mission."""
        found = self._found(key, known)
        assert found is not None, "it was played"
        return found

    def told(self, key: MissionKey, mission: TeamDriven) -> TeamOutcome:
        """What came of a mission, as of teams that react."""
        return mission.told or _told(self.team, key, mission)

    def wanted(self, key: MissionKey, *, traced: bool = False) -> Wanted:
        """A mission that is to be played."""
        return Wanted(self.team.orders, key, traced, self.team if self.reacts else None)

    def _on_route(self, fates: Sequence[RobotFate]) -> tuple[RobotFate, ...]:
        """Fates of robots that keep their routes: draws for longer ones mean nothing."""
        pois = [sum(own.is_poi(site) for site in own.route) for own in self.team.orders]
        return tuple(fate._replace(before_poi=NEVER) if fate.before_poi > most else fate
                     for fate, most in zip(fates, pois, strict=True))

    def _found(self, key: MissionKey, known: Mapping[MissionKey, TeamDriven]) -> TeamDriven | None:
        """What came of a mission, if that is known."""
        if key in known:
            return known[key]
        whole = known[key.unfailed]
        if not self.reacts:
            return cut_off(self.ways, self.team.orders, whole, key.fates)
        struck = any(fate.before_poi > 0 and (
            fate.before_poi <= robot.pois_reached + 1 or fate.lifetime_s <= robot.driven_s + _SPARE_S)
            for fate, robot in zip(key.fates, whole.robots, strict=True))
        return None if struck else whole


def _told(team: Team, key: MissionKey, mission: TeamDriven) -> TeamOutcome:
    """What came of a team that keeps its orders, as of those that react."""
    collected = {event.site for robot in mission.robots for event in robot.events if event.kind == "collected"}
    visits = [event.site for robot in mission.robots for event in robot.events
              if event.kind == "arrived" and event.site in team.pois]
    return TeamOutcome(
        robots=mission.robots, stops=mission.stops, reactions=(), fates=key.fates,
        doubled=len(visits) - len(set(visits)),
        left_over=tuple(tuple(site for site in own.route if site in team.pois - collected) for own in team.orders))


def _legs(world: World, costs: Mapping[str, FuelCosts], case: _Case, missions: Sequence[TeamDriven]
          ) -> tuple[LegTime, ...]:
    """Every leg of some missions, each by its first trial."""
    first: dict[int, tuple[int, int, TeamDriven]] = {}
    for key, trial, mission in zip(case.keys, case.plays.first, missions, strict=True):
        if id(mission) not in first or trial < first[id(mission)][0]:
            first[id(mission)] = trial, key.rollout, mission
    robots = world.robots
    return tuple(leg_times([costs[world.kind_of(robot)] for robot in robots], [robot.name for robot in robots],
                           {trial: (rollout, mission) for trial, rollout, mission in sorted(
                               first.values(), key=lambda one: one[0])}))


def _shown(
    world: World, costs: Mapping[str, FuelCosts], ground: Ground, settings: Settings, case: _Case, run: Reacted,
    executor: Executor | None, known: dict[MissionKey, TeamDriven],
) -> TeamTrace | None:
    """A typical mission with changed orders over time; ``None`` without any."""
    mission = typical(missions_of(run))
    if mission is None:
        return None
    key = case.keys[case.plays.kind_of(mission.trial)]
    return _trace(world, costs, settings, case, key, _traced(world, ground, settings, case, key, executor, known),
                  mission.trial)


def _traced(world: World, ground: Ground, settings: Settings, case: _Case, key: MissionKey,
            executor: Executor | None, known: dict[MissionKey, TeamDriven]) -> TeamDriven:
    """A mission with its poses."""
    play_all(world, ground, settings, [case.wanted(key, traced=True)], executor, None, known)
    return known[key]


def _trace(world: World, costs: Mapping[str, FuelCosts], settings: Settings, case: _Case, key: MissionKey,
           mission: TeamDriven, trial: int) -> TeamTrace:
    """A traced mission over time, with what was heard in it."""
    told = case.told(key, mission)
    waves = [draw_noise(world.noise, settings.seed, key.rollout, number).disturbance.waves
             for number in range(len(world.robots))]
    return TeamTrace(trial=trial, traces=traces_of(case.ways, case.team.orders, mission, waves),
                     news=news_of(world, costs, told))
