"""Routes, and missions of robots that meet, driven by the noisy twin under noise draws apart from those of any run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from sva_bench.arrays import BoolArray, FloatArray
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.drives import Courses, Drives, RouteKey, drive_all
from sva_bench.execution.judging import judge_route
from sva_bench.execution.margins import margins_of
from sva_bench.execution.orders import orders_of, planned_legs
from sva_bench.execution.outcome import Assignment
from sva_bench.execution.shared.execute import Wanted, ground_of, play_all
from sva_bench.execution.shared.players import MissionKey, TeamDriven
from sva_bench.execution.shared.unfailed import BAD, leavers, margins_of_missions, unfailed_keys
from sva_bench.mission.failures import PlanningTerms, process_of
from sva_bench.mission.plan import Plan
from sva_bench.seeds import Stream, seed_for
from sva_bench.travel.fuel import FuelCosts
from sva_bench.travel.leg_costs import LegSamples
from sva_bench.world.model import Scenario, World
from sva_bench.world.noise import Noise


def draws_seed(number: int) -> int:
    """Root seed of a set of noise draws; no run has it, and it is the same for all, as plans don't depend on seeds."""
    return int(seed_for(0, Stream.CALIBRATION, number).generate_state(1, np.uint64)[0] >> np.uint64(1))


def as_planned(world: World) -> bool:
    """Whether the twin drives every leg just as it was planned, with a full tank and without waiting for anybody."""
    if world.meets:
        return False
    ideal = replace(world.noise, hull_friction=0.0, payload_kg=(0.0, 0.0)) == Noise()
    return ideal and not any(passage.blocked > 0 and passage.wait_s > 0 for passage in world.passages)


class TwinDraws:
    """One set of noise draws, under which the twin drives whatever is asked for; what it has driven is kept.

    Args:
        world, costs: The world and its fuel costs.
        number: Of the set; sets are independent.
        executor: Where drives run; ``None`` = here.
    """

    def __init__(self, world: World, costs: Mapping[str, FuelCosts], number: int, executor: Executor | None) -> None:
        self._world, self._costs, self._executor = world, costs, executor
        self._settings = Settings(
            seed=draws_seed(number), trials=1, rollouts=1, fidelity="kinematic", recorded=False)
        self._courses, self._drives = Courses(world, costs, self._settings), Drives()

    def judge(self, scenario: Scenario, plan: Plan, draws: int) -> tuple[BoolArray, FloatArray]:
        """Whether a plan's mission goes wrong, nobody failing by draw, and its mean value over failures; draw by draw.

        Where robots meet, the team's missions are played. Of the value, robots wait for others as if none of these
        failed.

        Args:
            scenario: Who may fail.
            plan: The plan.
            draws: How many draws, from the first on.

        Returns:
            Both of shape (draws,).
        """
        process = process_of(self._world.execute_failure)
        reliabilities = [scenario.reliability(robot) for robot in self._world.robots]
        case = Case(scenario=scenario, planner="", plan=plan)
        orders = orders_of(self._world, case, planned_legs(self._world, self._costs, [case]))
        terms = process.terms(reliabilities)
        if self._world.meets:
            return self._judge_missions(case, orders, terms, draws)
        leaving = [(number, order) for number, order in enumerate(orders)
                   if order.route and process.can_leave(reliabilities[number])]
        self._drive({(order.robot, order.route, draw, 0): False for _, order in leaving for draw in range(draws)})
        bad, value = np.zeros(draws, dtype=np.bool_), np.zeros(draws)
        for number, order in leaving:
            driven = [self._drives.routes[order.robot, order.route, draw, 0] for draw in range(draws)]
            judged = judge_route(margins_of(number, order, driven), terms)
            bad, value = bad | judged.bad, value + judged.value
        return bad, value

    def _judge_missions(self, case: Case, orders: Sequence[Assignment], terms: PlanningTerms, draws: int
                        ) -> tuple[BoolArray, FloatArray]:
        """The same where robots meet."""
        keys = unfailed_keys(self._world, [case], orders, draws)
        played = self._missions(orders, keys)
        bad, value = np.zeros(draws, dtype=np.bool_), np.zeros(draws)
        if not keys:
            return bad, value
        for route in margins_of_missions(orders, zip(keys, played, strict=True)):
            if route.robot in leavers(keys[0]):
                value = value + judge_route(route, terms).value
        return np.array([any(outcome.end in BAD for outcome in mission.robots) for mission in played]), value

    def _missions(self, orders: Sequence[Assignment], keys: Sequence[MissionKey]) -> list[TeamDriven]:
        """Missions, played now or before."""
        known: dict[MissionKey, TeamDriven] = {}
        play_all(self._world, ground_of(self._world, self._costs), self._settings,
                 [Wanted(orders, key) for key in keys if key not in self._drives.missions], self._executor, None,
                 known)
        # What they looked like is of no use here, and takes much room.
        self._drives.missions.update({key: replace(mission, trails=(), cuts=()) for key, mission in known.items()})
        return [self._drives.missions[key] for key in keys]

    def legs(self, robot: str, sites: tuple[str, ...], draws: int) -> LegSamples:
        """What each leg between sites takes a robot, by the way that plans drive it.

        Args:
            robot: Its name.
            sites: Names of the sites.
            draws: How many draws.
        """
        n = len(sites)
        driving, waits, capacity = np.zeros((draws, n, n)), np.zeros((draws, n, n)), np.ones(draws)
        for i, origin in enumerate(sites):  # one after the other: of all at once there would be very many
            keys: dict[RouteKey, bool] = {(robot, (origin, site), draw, 0): False
                                          for site in sites if site != origin for draw in range(draws)}
            self._drive(keys)
            for name, route, draw, trial in keys:
                driven = self._drives.routes.pop((name, route, draw, trial))
                self._drives.whole.pop((name, route, draw, trial), None)
                j = sites.index(route[1])
                driving[draw, i, j] = np.inf if driven.stuck else driven.leg_s.sum()
                waits[draw, i, j], capacity[draw] = driven.waited_s.sum(), driven.capacity
        return LegSamples(driving_s=driving, waits_s=waits, capacity=capacity)

    def _drive(self, wanted: Mapping[RouteKey, bool]) -> None:
        drive_all(self._courses.chunks(wanted, self._drives), self._drives, self._executor, None)
        self._courses.compose(wanted, self._drives)
