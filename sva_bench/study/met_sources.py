"""What robots of one world do to a plan, and what each source of noise does to it there.

The twin plays the run's missions again: with all sources, without each, and with each robot alone from its berth, where
it neither heeds nor touches the others. What the last makes other is due to the others. It is divided into detours,
the time of the legs that led another way, and waits: the rest.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sva_bench.analysis.results import SourceEffect
from sva_bench.choices import NoiseName, SourceName
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.execute import NOTHING
from sva_bench.execution.orders import orders_of, planned_legs
from sva_bench.execution.outcome import Assignment, Driven, RobotFate
from sva_bench.execution.rules import settle
from sva_bench.execution.shared.execute import CaseTrials, Ground, Wanted, execute_team, ground_of, play_all, ways_of
from sva_bench.execution.shared.players import MissionKey, TeamDriven
from sva_bench.execution.shared.unfailed import as_ordered_until, leavers, unfailed_keys
from sva_bench.execution.sources import OF_PHYSICS, sources_on, without
from sva_bench.study.effects import Effects, Grounds
from sva_bench.world.model import World

Missions = Mapping[MissionKey, TeamDriven]
CaseName = tuple[str, str]
"""Scenario and planner."""


@dataclass(frozen=True, eq=False, kw_only=True)
class _Twin:
    """What the twin makes of some cases.

    Attributes:
        value: Mean value of each case.
        missions: The missions of its trials.
        whole: The mission of each case under each noise draw in which nobody fails, driven to its end.
    """

    value: Mapping[CaseName, float]
    missions: Missions
    whole: Missions

    def taken_s(self, keys: Sequence[MissionKey]) -> float:
        """Mean time that missions take, added up over robots [s]."""
        return _mean([_taken_s(self.whole[key]) for key in keys])


def met_effects(grounds: Grounds, cases: Sequence[Case]) -> dict[CaseName, Effects]:
    """What is known of the sources of some plans in a world whose robots meet.

    Args:
        grounds: What the run was executed with.
        cases: The plans.
    """
    return _Told(grounds, cases).effects()


class _Told:
    """The cases of a run, told by the twin."""

    def __init__(self, grounds: Grounds, cases: Sequence[Case]) -> None:
        self._grounds, self._cases, self._world = grounds, cases, grounds.world
        # Berths and the order keep what they are made for, whatever is switched off.
        self._ground: Ground = ground_of(grounds.world, grounds.costs)
        self._settings: Settings = replace(grounds.settings, fidelity="kinematic", recorded=False)
        planned = planned_legs(grounds.world, grounds.costs, cases)
        self._orders: dict[CaseName, Sequence[Assignment]] = {
            _name(case): orders_of(grounds.world, case, planned) for case in cases}
        self._keys = {_name(case): unfailed_keys(grounds.world, [case], self._orders[_name(case)], min(
            self._settings.rollouts, self._settings.trials)) for case in cases}

    def effects(self) -> dict[CaseName, Effects]:
        """What is known of each case."""
        world, sources = self._world, sources_on(self._world)
        known = {key: mission for key, mission in self._grounds.drives.missions.items() if not mission.in_physics}
        everything = self._by_twin(world, known)
        lacking = {source: self._by_twin(without(world, source), {}) for source in sources if source not in OF_PHYSICS}
        alone = self._whole(alone=True, known={})
        physics = next((source for source in OF_PHYSICS if source in sources), None)
        kinematic = self._grounds.settings.fidelity == "kinematic"
        return {_name(case): self._effects(case, everything, lacking, alone, None if kinematic else physics)
                for case in self._cases}

    def _effects(self, case: Case, everything: _Twin, lacking: Mapping[NoiseName, _Twin], alone: Missions,
                 of_physics: NoiseName | None) -> Effects:
        name = _name(case)
        keys, taken_s = self._keys[name], everything.taken_s(self._keys[name])
        by_source: dict[SourceName, SourceEffect] = {source: SourceEffect(
            incentive=everything.value[name] - twin.value[name] + 0.0, seconds=taken_s - twin.taken_s(keys) + 0.0)
            for source, twin in lacking.items()}
        by_source |= self._of_others(case, everything, alone)
        physics_s = _mean([_taken_s(run) - _taken_s(everything.missions[key]) for key in keys
                           if (run := self._grounds.drives.missions.get(key)) and key in everything.missions])
        leave = leavers(keys[0]) if keys else []
        planned_s = math.fsum(math.fsum(self._orders[name][number].planned_s) for number in leave)
        rest_s = taken_s - planned_s - math.fsum(effect.seconds for effect in by_source.values())
        return Effects(by_source=by_source, twin=everything.value[name],
                       rest_s=rest_s if of_physics else rest_s + physics_s,
                       of_physics=(of_physics, physics_s) if of_physics else None)

    def _of_others(self, case: Case, everything: _Twin, alone: Missions) -> dict[SourceName, SourceEffect]:
        """What the others do to each robot."""
        name = _name(case)
        keys, value = self._keys[name], everything.value[name]
        of_one, led_round = self._alone(case, everything.missions, alone)
        taken_s = everything.taken_s(keys) - _mean([_taken_s(alone[key]) for key in keys])
        if self._world.interaction == "uncoordinated":
            return {"collisions": SourceEffect(incentive=value - of_one + 0.0, seconds=taken_s + 0.0)}
        longer_s = _mean([math.fsum(
            more for number, own in enumerate(self._orders[name])
            for more in _longer_s(own, everything.whole[key], number, alone[key].driven[number]).values())
            for key in keys])
        return {"waits": SourceEffect(incentive=value - led_round + 0.0, seconds=taken_s - longer_s + 0.0),
                "detours": SourceEffect(incentive=led_round - of_one + 0.0, seconds=longer_s + 0.0)}

    def _alone(self, case: Case, missions: Missions, alone: Missions) -> tuple[float, float]:
        """Mean value if each robot were alone, and if it were but drove the ways that it was led round others."""
        name = _name(case)
        orders = self._orders[name]
        team = CaseTrials(self._world, ways_of(self._ground), case, orders, self._settings)
        by_draw = {key.rollout: alone[key].driven for key in self._keys[name]}
        settled: dict[tuple[int, int, RobotFate], float] = {}
        values = np.zeros((2, self._settings.trials, len(orders)))
        for row in range(self._settings.trials):
            mission, draw = team.mission(row, missions), team.rollout(row)
            for number, (own, fate) in enumerate(zip(orders, team.fates(row), strict=True)):
                driven = by_draw[draw][number] if draw in by_draw else NOTHING
                key = number, draw, fate
                if key not in settled:
                    settled[key] = settle(own, driven, fate).value
                values[:, row, number] = settled[key]
                if longer := _longer_s(own, mission, number, driven):
                    leg_s = [time_s + longer.get(leg, 0.0) for leg, time_s in enumerate(driven.leg_s.tolist())]
                    values[1, row, number] = settle(own, replace(driven, leg_s=np.array(leg_s)), fate).value
        of_one, led_round = (float(np.mean(each.sum(axis=1))) for each in values)
        return of_one, led_round

    def _by_twin(self, world: World, known: Missions) -> _Twin:
        """What the twin makes of the cases in a world, on the trials and noise draws of the run."""
        missions = dict(known)
        executed = execute_team(world, self._grounds.costs, self._cases, self._settings, self._grounds.executor, None,
                                missions, self._ground)
        return _Twin(missions=missions, whole=self._whole(world, known=missions), value={
            _name(run.case): float(np.mean(run.value.sum(axis=1))) for run in executed})

    def _whole(self, world: World | None = None, *, known: Missions, alone: bool = False) -> Missions:
        """The missions in which nobody fails, driven to their ends though a tank be empty."""
        wanted = [Wanted([replace(own, fuel_capacity_s=math.inf, mission_limit_s=math.inf)
                          for own in self._orders[name]], key) for name, keys in self._keys.items() for key in keys]
        found = {one.key: known[one.key] for one in wanted if one.key in known and not any(
            outcome.end == "out_of_fuel" for outcome in known[one.key].robots)}
        play_all(world or self._world, self._ground, self._settings, wanted, self._grounds.executor, None, found,
                 alone=alone)
        return found


def _name(case: Case) -> CaseName:
    return case.scenario.name, case.planner


def _taken_s(mission: TeamDriven) -> float:
    """Driving time and waits of all robots, and by how much later they leave [s]; of one that got stuck, until then."""
    return math.fsum(float(driven.leg_s.sum() + driven.waited_s.sum() + driven.start_s) for driven in mission.driven)


def _mean(figures: Sequence[float]) -> float:
    return math.fsum(figures) / len(figures) if figures else 0.0


def _longer_s(orders: Assignment, mission: TeamDriven, number: int, alone: Driven) -> dict[int, float]:
    """How much longer than the shortest way each leg took that led another one because of others [s].

    Args:
        orders: The robot's orders.
        mission: What the team drove.
        number: The robot's position in it.
        alone: What the robot drives alone.
    """
    legs = min(as_ordered_until(orders, mission.stops[number]), mission.robots[number].stops_reached,
               len(alone.leg_s) - alone.stuck)
    driven_s = mission.driven[number].leg_s
    return {leg: float(driven_s[leg] - alone.leg_s[leg])
            for leg, led_round in enumerate(mission.led_round[number][:legs]) if led_round}
