"""Plans of robots that share a world executed: each distinct mission once, whole teams at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from sva_bench.choices import Fidelity
from sva_bench.errors import BadInput
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.executed import Executed, LegTime
from sva_bench.execution.fate import draw_fate
from sva_bench.execution.known_team import Team
from sva_bench.execution.margins import Margins
from sva_bench.execution.meetings import Meetings
from sva_bench.execution.noise import draw_noise
from sva_bench.execution.orders import orders_of, planned_legs
from sva_bench.execution.outcome import Assignment, RobotFate, Trace
from sva_bench.execution.settling import figures_of, left_by_draws
from sva_bench.execution.shared.drive import TeamRun, drive_team
from sva_bench.execution.shared.own_ways import Ways
from sva_bench.execution.shared.planning import first_order
from sva_bench.execution.shared.players import MissionKey, TeamDriven
from sva_bench.execution.shared.trace import leg_times, traces_of
from sva_bench.execution.shared.truncation import cut_off
from sva_bench.execution.shared.unfailed import margins_of_missions
from sva_bench.files.digest import digest
from sva_bench.mission.failures import process_of
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.model import World

_CHUNK = 32  # missions that a worker plays at a time, of one plan and one set of robots that leave


@dataclass(frozen=True, kw_only=True)
class Ground:
    """A world whose robots meet, and their fuel costs; the same as another of the same content.

    Attributes:
        content: Digest of what the ways of robots depend on.
        world, costs: The world and its fuel costs, by robot.
    """

    content: str
    world: World = field(compare=False)
    costs: Mapping[str, FuelCosts] = field(compare=False)


def ground_of(world: World, costs: Mapping[str, FuelCosts]) -> Ground:
    """The ground of a world."""
    content = digest(world.obstacles, world.sites, [(robot.name, robot.model) for robot in world.robots],
                     world.noise.localisation, [costs[world.kind_of(robot)].repaired_ms for robot in world.robots])
    return Ground(content=content, world=world, costs=costs)


@lru_cache(maxsize=2)  # a worker plays missions of one world after the other, plan by plan
def ways_of(ground: Ground) -> Ways:
    """The ways of a world's robots, kept from one plan to the next."""
    return Ways(ground.world, ground.costs)


@dataclass(frozen=True, eq=False, kw_only=True)
class TeamTask:
    """Missions of one plan from which the same robots leave: all that a worker needs.

    Attributes:
        world: The world.
        ground: What the ways of its robots depend on.
        orders: The robots' orders.
        team: What the team does about news; ``None`` if it keeps its orders.
        keys: The missions.
        traced: Whether poses are kept, by mission.
        seed, fidelity: As of the settings.
        alone: Whether robots neither heed nor touch each other.
    """

    world: World
    ground: Ground
    orders: tuple[Assignment, ...]
    keys: tuple[MissionKey, ...]
    traced: tuple[bool, ...]
    seed: int
    fidelity: Fidelity
    alone: bool = False
    team: Team | None = None


class Wanted(NamedTuple):
    """A mission that is to be played, and whether poses are kept; ``team``: as of ``TeamTask``."""

    orders: Sequence[Assignment]
    key: MissionKey
    traced: bool = False
    team: Team | None = None


def play_missions(task: TeamTask) -> tuple[TeamDriven, ...]:
    """Play the missions of a task.

    Raises:
        BadInput: If no order of its robots is found: never, as long as berths leave all ways open.
    """
    world, ways = task.world, ways_of(task.ground)
    leaves = tuple(fate.before_poi > 0 and bool(own.route)
                   for fate, own in zip(task.keys[0].fates, task.orders, strict=True))
    order = None
    if world.interaction == "shared" and not task.alone:
        order = first_order(ways, task.orders, leaves)
        if order is None:
            raise BadInput(f"{world.name}: there is no order in which its robots get by each other, not even one after "
                           "the other; move the base to a more open place, or widen the passages about it")
    played = []
    for key, traced in zip(task.keys, task.traced, strict=True):
        drawn = [draw_noise(world.noise, task.seed, key.rollout, number) for number in range(len(world.robots))]
        played.append(drive_team(TeamRun(
            world=world, ways=ways, orders=task.orders, fates=key.fates, drawn=drawn, order=order, alone=task.alone,
            noise_index=(task.seed, key.rollout), team=task.team), task.fidelity, traced=traced))
    return tuple(played)


def execute_team(
    world: World, costs: Mapping[str, FuelCosts], cases: Sequence[Case], settings: Settings,
    executor: Executor | None, progress: Callable[[int, int], None] | None, known: dict[MissionKey, TeamDriven],
    ground: Ground | None = None,
) -> list[Executed]:
    """Execute plans over all trials, as ``execute`` does for robots that don't meet.

    A mission depends on who fails when: it is played once for each distinct set of fates and noise draw. Where it shows
    in the mission without failures that a failure touches nobody else, the robot's own mission is cut off there.

    Args:
        world, costs, cases, settings, executor, progress: As of ``execute``.
        known: Missions played already; what is played now is added.
        ground: What the robots' ways depend on; ``None`` = on this world.
    """
    planned, ground = planned_legs(world, costs, cases), ground or ground_of(world, costs)
    ways = ways_of(ground)
    teams = [CaseTrials(world, ways, case, orders_of(world, case, planned), settings) for case in cases]
    play_all(world, ground, settings, [Wanted(team.orders, key, traced) for team in teams
                                       for key, traced in team.unfailed().items()], executor, progress, known)
    play_all(world, ground, settings, [Wanted(team.orders, key, traced) for team in teams
                                       for key, traced in team.failed(known).items()], executor, progress, known)
    return [team.executed(costs, known) for team in teams]


def play_all(
    world: World, ground: Ground, settings: Settings, wanted: Sequence[Wanted], executor: Executor | None,
    progress: Callable[[int, int], None] | None, known: dict[MissionKey, TeamDriven], *, alone: bool = False,
) -> None:
    """Play missions that are not known yet.

    Args:
        world: The world that robots meet.
        ground: What their ways depend on.
        settings: Seed and fidelity.
        wanted: The missions.
        executor: Where missions are played; ``None`` = here.
        progress: Called with the number of missions played and of all.
        known: Missions played already; what is played now is added.
        alone: Whether robots neither heed nor touch each other.
    """
    groups: dict[MissionKey, dict[MissionKey, Wanted]] = {}  # by the mission in which the same robots leave
    for one in wanted:
        if one.key not in known or (one.traced and not known[one.key].traced):
            group = groups.setdefault(one.key.unfailed._replace(rollout=0), {})
            if one.key not in group or one.traced:
                group[one.key] = one
    tasks = []
    for group in groups.values():
        members = list(group.values())
        for first in range(0, len(members), _CHUNK):
            mine = members[first:first + _CHUNK]
            tasks.append(TeamTask(
                world=world, ground=ground, orders=tuple(mine[0].orders), keys=tuple(one.key for one in mine),
                traced=tuple(one.traced for one in mine), seed=settings.seed, fidelity=settings.fidelity,
                team=mine[0].team, alone=alone))
    count, of = 0, sum(len(task.keys) for task in tasks)
    for task, played in _played(tasks, executor):
        known.update(zip(task.keys, played, strict=True))
        count += len(played)
        if progress:
            progress(count, of)


def _played(tasks: Sequence[TeamTask], executor: Executor | None
            ) -> Iterator[tuple[TeamTask, tuple[TeamDriven, ...]]]:
    """Tasks with what came of them, here or by workers, as they are done."""
    if executor is None:
        for task in tasks:
            yield task, play_missions(task)
        return
    futures = {executor.submit(play_missions, task): task for task in tasks}
    try:
        for future in as_completed(futures):
            yield futures[future], future.result()
    finally:
        for future in futures:
            future.cancel()


class CaseTrials:
    """The trials of one case."""

    def __init__(self, world: World, ways: Ways, case: Case, orders: Sequence[Assignment], settings: Settings) -> None:
        self.orders = orders
        self._world, self._ways, self._case, self._settings = world, ways, case, settings
        self._routes = tuple(own.route for own in orders)
        self._fate = draw_fate(world, case.scenario, [sum(o.is_poi(s) for s in o.route) for o in orders], settings)
        self._fates = [tuple(self._fate.of(row, number) for number in range(len(orders)))
                       for row in range(settings.trials)]

    def unfailed(self) -> dict[MissionKey, bool]:
        """Every trial's mission if no robot fails on its way, and whether its poses are kept."""
        found: dict[MissionKey, bool] = {}
        for row in range(self._settings.trials):
            found.setdefault(self._unfailed(row), self._traced(row))
        return found

    def failed(self, known: Mapping[MissionKey, TeamDriven]) -> dict[MissionKey, bool]:
        """Missions that failures on the way make another than they'd be without, and whether poses are kept."""
        found: dict[MissionKey, bool] = {}
        for row in range(self._settings.trials):
            if self._key(row) != self._unfailed(row) and self._cut_off(row, known) is None:
                found.setdefault(self._key(row), self._traced(row))
        return found

    def _traced(self, row: int) -> bool:
        return self._settings.recorded and row == 0

    def _key(self, row: int) -> MissionKey:
        return MissionKey(self._routes, self._fates[row], int(self._fate.rollout[row]))

    def _unfailed(self, row: int) -> MissionKey:
        """The mission of a trial if no robot fails on its way."""
        return self._key(row).unfailed

    def _cut_off(self, row: int, known: Mapping[MissionKey, TeamDriven]) -> TeamDriven | None:
        """The mission without failures, cut off by those of a trial; ``None`` if they touch another robot."""
        whole = known[self._unfailed(row)]
        if row == 0 and self._settings.recorded:  # it is shown
            return None
        return cut_off(self._ways, self.orders, whole, self._fates[row])

    def mission(self, row: int, known: Mapping[MissionKey, TeamDriven]) -> TeamDriven:
        """A trial's mission, played itself or cut off one without failures."""
        mission = known.get(self._key(row)) or self._cut_off(row, known)
        assert mission is not None
        return mission

    def fates(self, row: int) -> tuple[RobotFate, ...]:
        """When each robot fails in a trial."""
        return self._fates[row]

    def rollout(self, row: int) -> int:
        """The noise draw of a trial."""
        return int(self._fate.rollout[row])

    def executed(self, costs: Mapping[str, FuelCosts], known: Mapping[MissionKey, TeamDriven]) -> Executed:
        """What came of the trials."""
        found: dict[MissionKey, tuple[int, TeamDriven]] = {}
        number: dict[MissionKey, int] = {}
        kind = np.zeros(self._settings.trials, dtype=np.int64)
        for row in range(self._settings.trials):
            key = self._key(row)
            if key not in found:
                found[key] = row, self.mission(row, known)
            kind[row] = number.setdefault(key, len(number))
        distinct = [mission for _, mission in found.values()]
        columns = [figures_of([mission.robots[k] for mission in distinct]) for k in range(len(self.orders))]
        figures = {name: np.column_stack([column[name] for column in columns])[kind] for name in columns[0]}
        fate, case, world = self._fate, self._case, self._world
        drawn = [left_by_draws(o, fate.fails[:, k], fate.lifetime_s[:, k]) for k, o in enumerate(self.orders)]
        robots = tuple(robot.name for robot in world.robots)
        return Executed(
            case=case, robots=robots, rollout=fate.rollout,
            planned_incentive=np.array([sum(o.incentives.get(s, 0.0) for s in o.route) for o in self.orders]),
            drawn_value=np.column_stack([value for value, _ in drawn]),
            drawn_failed=np.column_stack([fails for _, fails in drawn]),
            terms=process_of(world.execute_failure).terms([case.scenario.reliability(r) for r in world.robots]),
            margins=self._margins(known),
            available=figures["available"].astype(np.bool_), lost=figures["lost"].astype(np.bool_),
            incentive=figures["incentive"], value=figures["value"], end_time_s=figures["end_time_s"],
            fuel_used_s=figures["fuel_used_s"], waited_s=figures["waited_s"],
            **{name: figures[name].astype(np.int64) for name in ("pois_reached", "stops_reached", "end", "contacts")},
            legs=self._legs(costs, found), traces=self._traces(found), meetings=meetings_of(distinct).rows(kind))

    def _margins(self, known: Mapping[MissionKey, TeamDriven]) -> tuple[Margins, ...]:
        """What each route left of fuel and time where nobody fails on the way, under each noise draw."""
        return margins_of_missions(self.orders, [(key, known[key]) for key in self.unfailed()])

    def _legs(self, costs: Mapping[str, FuelCosts], found: Mapping[MissionKey, tuple[int, TeamDriven]]
              ) -> tuple[LegTime, ...]:
        if not self._settings.recorded:
            return ()
        robots = self._world.robots
        first = self._settings.first
        return tuple(leg_times([costs[self._world.kind_of(robot)] for robot in robots], [r.name for r in robots], {
            first + row: (key.rollout, mission) for key, (row, mission) in found.items()}))

    def _traces(self, found: Mapping[MissionKey, tuple[int, TeamDriven]]) -> tuple[Trace, ...]:
        if not self._settings.recorded:
            return ()
        mission = found[self._key(0)][1]
        drawn = [draw_noise(self._world.noise, self._settings.seed, int(self._fate.rollout[0]), number)
                 for number in range(len(self.orders))]
        return traces_of(self._ways, self.orders, mission, [mine.disturbance.waves for mine in drawn])


def meetings_of(missions: Sequence[TeamDriven]) -> Meetings:
    """What robots did to each other in some missions, each of which was played or is provably one that was."""
    return Meetings(
        contacts=np.array([mission.contacts for mission in missions], dtype=np.int64),
        waited_s=np.array([mission.waited_s for mission in missions]), exact=np.ones(len(missions), dtype=np.bool_),
        detours=np.array([mission.detours for mission in missions], dtype=np.int64))
