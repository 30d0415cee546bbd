"""Tiny teams played by the engine: without noise, over every history or by fates drawn ahead."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from sva_bench.choices import News
from sva_bench.execution.chance import Chance, Histories, History, Window
from sva_bench.execution.outcome import Assignment
from sva_bench.execution.policies.policy import Orders, Policy, TeamState
from sva_bench.execution.policies.registry import POLICIES, Means
from sva_bench.execution.rules import LegDriven
from sva_bench.execution.team import Team, play
from sva_bench.execution.team_outcome import TeamOutcome
from sva_bench.mission.failures import process_of
from sva_bench.mission.instance import Instance
from sva_bench.solver.rest import plan_rest
from tests.oracles.reactions import Answer
from tests.oracles.rest import Ground, Here

Plan = Sequence[tuple[int, ...]]


class Enumerated:
    """The policy of the engine that decides by brute force: the best orders for the rest if nobody reacts again."""

    def __init__(self, ground: Ground) -> None:
        self._ground = ground
        self._number = {v.name: k for k, v in enumerate(ground.instance.vehicles)}

    def __call__(self, state: TeamState) -> Orders:
        """The orders of robots that are reached."""
        sites = self._ground.instance.sites
        _, orders = self._ground.best_of_rest(self.reached(state), self.free(state))
        return {self._ground.instance.vehicles[k].name: tuple(sites[j] for j in own) for k, own in orders.items()}

    def free(self, state: TeamState) -> int:
        """POIs that the robots reached may have."""
        claimed = {site for robot in state.robots if not robot.reached and robot.standing != "dead"
                   for site in robot.remaining}
        return sum(self._ground.bit[self._ground.instance.sites.index(p)] for p in state.open_pois - claimed)

    def reached(self, state: TeamState) -> list[Here]:
        """The robots that are reached, each at its next epoch."""
        sites = self._ground.instance.sites
        return [Here(self._number[r.robot], sites.index(r.site), r.ready_s, r.burnt_s, self._alive(r.robot, state),
                     tuple(sites.index(site) for site in r.remaining)) for r in state.robots if r.reached]

    def _alive(self, robot: str, state: TeamState) -> float:
        """Probability that a robot is alive, given what is known of all."""
        known = {r.robot: r.standing for r in state.robots}
        if self._ground.process != "mission" or known[robot] != "unheard":
            return 1.0
        instance = self._ground.instance
        if instance.joint is None:
            return instance.vehicle(robot).availability
        likely = [s for s in instance.joint if all(
            (name in s.available) == (standing != "dead") for name, standing in known.items() if standing != "unheard")]
        return sum(s.probability for s in likely if robot in s.available) / sum(s.probability for s in likely)


def enumerated(ground: Ground) -> Answer:
    """The same as the oracle's answer."""
    return lambda robots, free: ground.best_of_rest(robots, free)[1]


def resolve(instance: Instance) -> Policy:
    """The policy that plans the rest again."""
    return POLICIES["resolve"](Means(instance=instance, plans_rest=plan_rest))


def keep(instance: Instance) -> Policy:
    """The policy that keeps the plan."""
    return POLICIES["none"](Means(instance=instance, plans_rest=plan_rest))


@dataclass
class Heard:
    """A policy, and the states that it was asked about."""

    policy: Policy
    states: list[TeamState] = field(default_factory=list)

    def __call__(self, state: TeamState) -> Orders:
        """What the policy says."""
        self.states.append(state)
        return self.policy(state)


class Kept:
    """A history whose answers can be drawn ahead: which robots never leave, and where lifetimes end."""

    def __init__(self, chance: Chance) -> None:
        self._chance = chance
        self.stays: set[int] = set()
        self.windows: dict[int, Window] = {}

    def leaves(self, robot: int) -> bool:
        """As the history says."""
        able = self._chance.leaves(robot)
        if not able:
            self.stays.add(robot)
        return able

    def tries(self, robot: int, number: int) -> bool:
        """As the history says."""
        return self._chance.tries(robot, number)

    def drives(self, robot: int, since_s: float, until_s: float) -> Window | None:
        """As the history says."""
        window = self._chance.drives(robot, since_s, until_s)
        if window is not None:
            self.windows[robot] = window
        return window

    def failed_by(self, robot: int, window: Window, driven_s: float) -> Window | None:
        """As the history says."""
        return self._chance.failed_by(robot, window, driven_s)

    def middle_s(self, robot: int, window: Window) -> float:
        """As the history says: the window is the narrowest."""
        self.windows[robot] = window
        return self._chance.middle_s(robot, window)


def team_of(instance: Instance, plan: Plan, policy: Policy, news: News) -> Team:
    """The team of an instance and a plan, which knows how long its legs take."""
    sites = instance.sites
    stops = dict(zip(sites, instance.stop_s.tolist(), strict=True))
    orders = tuple(Assignment(
        robot=v.name, route=tuple(sites[j] for j in (instance.base, *route)) if route else (),
        stations=frozenset(sites[j] for j in instance.stations), stop_s=stops, fuel_capacity_s=v.fuel_capacity_s,
        incentives=dict(zip(sites, v.incentives.tolist(), strict=True)), mission_limit_s=v.mission_limit_s,
        loss_cost=v.loss_cost) for v, route in zip(instance.vehicles, plan, strict=True))
    return Team(orders=orders, base=sites[instance.base], pois=frozenset(sites[j] for j in instance.pois),
                policy=policy, news=news, scheduled_s=scheduled(instance))


def scheduled(instance: Instance) -> Callable[[int, str, str], float]:
    """Planned driving times."""
    return lambda robot, here, there: float(
        instance.vehicles[robot].fuel_s[instance.sites.index(here), instance.sites.index(there)])


def legs_of(instance: Instance) -> Callable[[int, tuple[str, ...]], LegDriven]:
    """Legs that take as long as planned."""
    planned = scheduled(instance)
    return lambda robot, stops: LegDriven(planned(robot, stops[-2], stops[-1]))


def all_histories(team: Team, instance: Instance) -> Iterator[tuple[History, Kept, TeamOutcome]]:
    """Every history, and what comes of it."""
    terms = process_of(instance.failure).terms([v.reliability for v in instance.vehicles])
    for history in Histories(terms, instance.joint, [v.name for v in instance.vehicles]):
        kept = Kept(history)
        yield history, kept, play(team, kept, legs_of(instance))


def value_of(outcome: TeamOutcome) -> float:
    """What a team's mission was worth."""
    return sum(robot.value for robot in outcome.robots)


def expected(instance: Instance, plan: Plan, policy: Policy, news: News) -> float:
    """The expected value of a plan under a policy, over every history."""
    team = team_of(instance, plan, policy, news)
    return sum(history.weight * value_of(outcome) for history, _, outcome in all_histories(team, instance))
