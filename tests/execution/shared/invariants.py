"""What must hold in every shared mission, looked at from outside: by poses over time and by each robot's sums."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.execution.case import Settings
from sva_bench.execution.fate import draw_fate
from sva_bench.execution.outcome import RobotFate
from sva_bench.execution.shared.execute import TeamTask, ground_of, play_missions
from sva_bench.execution.shared.mission import DEADLOCK
from sva_bench.execution.shared.own_ways import Ways
from sva_bench.execution.shared.players import MissionKey, TeamDriven
from sva_bench.robot.follower import CONTROL_HZ
from tests.execution.shared.random_missions import Ready

TICK_S = 1.0 / CONTROL_HZ
_GRID_S = 0.05  # as poses are kept
_MUTUAL_S = 2.0  # for which a robot may slow down before a gate that another will open, while that waits for it
_TICKS = 3  # by which a sum may be off: a start between two control steps, and rounding at each end


def fates_of(ready: Ready, seed: int, trials: int, rollouts: int) -> list[tuple[tuple[RobotFate, ...], int]]:
    """The fates of some trials, and the noise draw of each."""
    settings = Settings(seed=seed, trials=trials, rollouts=rollouts, fidelity="kinematic", recorded=False)
    pois = [sum(own.is_poi(site) for site in own.route) for own in ready.orders]
    fate = draw_fate(ready.world, ready.case.scenario, pois, settings)
    return [(tuple(fate.of(row, k) for k in range(len(pois))), int(fate.rollout[row])) for row in range(trials)]


def played(ready: Ready, seed: int, fates: Sequence[RobotFate], rollout: int, *, physics: bool = False) -> TeamDriven:
    """One mission played with its poses."""
    task = TeamTask(
        world=ready.world, ground=ground_of(ready.world, ready.costs), orders=ready.orders, seed=seed, traced=(True,),
        keys=(MissionKey(tuple(own.route for own in ready.orders), tuple(fates), rollout),),
        fidelity="physics" if physics else "kinematic")
    (mission,) = play_missions(task)
    return mission


def ways_of(ready: Ready) -> Ways:
    return Ways(ready.world, ready.costs)


def places_over_time(mission: TeamDriven) -> FloatArray:
    """Where each robot's middle is each 50 ms until all missions are over [m], shape (robots, times, 2).

    A robot stands from the end of a leg, or of a part of one, to the beginning of the next, and after its last.
    """
    ends = max((part.clock_s for trail in mission.trails for parts in trail for part in parts), default=0.0)
    clock = np.arange(0.0, ends + 1.0, _GRID_S)
    places = np.empty((len(mission.names), len(clock), 2))
    for robot, (start, trail) in enumerate(zip(mission.starts, mission.trails, strict=True)):
        time, pose = [np.zeros(1)], [np.array([start[:2]], dtype=np.float64)]
        for part in (part for parts in trail for part in parts):
            begun = part.clock_s - part.driving_s - sum(wait.lasts_s for wait in part.waits)
            time += [np.array([begun]), begun + part.since_s]
            pose += [pose[-1][-1:], part.pose[:, :2]]
        at, where = np.concatenate(time), np.concatenate(pose)
        places[robot] = np.column_stack([np.interp(clock, at, where[:, axis]) for axis in (0, 1)])
    return places


def broken(ready: Ready, mission: TeamDriven, *, physics: bool = False) -> list[str]:
    """What doesn't hold in a mission."""
    found = []
    ways, names = ways_of(ready), [own.robot for own in ready.orders]
    radius = [ways.model(k).radius_m for k in range(len(names))]
    places = places_over_time(mission)
    for i, j in combinations(range(len(names)), 2):
        gap = np.hypot(*(places[i] - places[j]).T) - radius[i] - radius[j]
        if gap.min() < 0:
            found.append(f"{names[i]} and {names[j]} touch: {gap.min():.3f} m at {gap.argmin() * _GRID_S:.2f} s, "
                         f"{mission.robots[i].end} and {mission.robots[j].end}")
    if mission.contacts:
        found.append(f"{mission.contacts} contacts")
    for number, (own, outcome) in enumerate(zip(ready.orders, mission.robots, strict=True)):
        last = outcome.events[-1] if outcome.events else None
        if outcome.end == "stuck" and last is not None and (not last.what or last.what == DEADLOCK):
            found.append(f"{own.robot} is stuck by {last.what or 'nothing'}")
        if outcome.end == "stuck" and not physics and last is not None and last.what not in {*names, "no way on"}:
            found.append(f"{own.robot} is stuck by {last.what}")
        found += [f"{own.robot}: {said}" for said in _sums(ready, mission, number)]
    return found + _vain_waits(mission)


def _vain_waits(mission: TeamDriven) -> list[str]:
    """Waits for robots that stand for good already, and of two robots for each other."""
    found = []
    waits: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for name, outcome in zip(mission.names, mission.robots, strict=True):
        for event in outcome.events:
            if event.kind == "waits":
                waits.setdefault((name, event.what), []).append((event.time_s, event.time_s + event.lasts_s))
    for (name, cause), spans in waits.items():
        if cause in mission.names:
            other = mission.robots[mission.names.index(cause)]
            latest = max(end for _, end in spans)
            if latest > other.end_time_s + _TICKS * TICK_S:
                found.append(f"{name} waits for {cause} until {latest} s, {other.end} at {other.end_time_s} s")
            found += [f"{name} and {cause} wait for each other until {min(end, its_end)} s" for begin, end in spans
                      for its_begin, its_end in waits.get((cause, name), [])
                      if min(end, its_end) - max(begin, its_begin) > _MUTUAL_S]
    return found


def _sums(ready: Ready, mission: TeamDriven, number: int) -> list[str]:
    """Which of a robot's sums don't add up."""
    own, outcome, driven = ready.orders[number], mission.robots[number], mission.driven[number]
    stops = mission.stops[number]
    waited = [wait.lasts_s for wait in driven.waits]
    said = []
    if any(lasts < 0 for lasts in waited) or outcome.waited_s < 0:
        said.append(f"waits of {min(waited)} s")
    if not math.isclose(outcome.waited_s, sum(waited), abs_tol=1e-6) and outcome.end != "out_of_fuel":
        said.append(f"waited {outcome.waited_s} s, not {sum(waited)} s")
    charged, stood = _stopped(ready, mission, number)
    total = driven.start_s + outcome.driven_s + outcome.waited_s + charged + stood
    if abs(total - outcome.end_time_s) > 1e-6 and outcome.end != "out_of_fuel":
        said.append(f"{total} s of driving, waits and stops end at {outcome.end_time_s} s")
    burnt = outcome.driven_s + own.idle_share * (outcome.waited_s + stood)
    home_s = own.stop_s[stops[-1]] if outcome.end in ("home", "late") and outcome.stops_reached else 0.0
    if abs(burnt - own.idle_share * home_s - outcome.fuel_used_s) > 1e-6 and outcome.end != "out_of_fuel":
        said.append(f"{burnt} s of fuel by driving and idling, {outcome.fuel_used_s} s by its mission")
    # Its legs on the clock of the team: each begins when its stop is over, and no clock runs away from another.
    trail = mission.trails[number]
    if trail and trail[-1] and outcome.end in ("home", "late"):
        ticks = _TICKS * sum(len(parts) for parts in trail)
        clock = trail[-1][-1].clock_s + own.stop_s[stops[-1]]
        if abs(clock - outcome.end_time_s) > ticks * TICK_S:
            said.append(f"home at {outcome.end_time_s} s by its mission, at {clock} s by the team's clock")
    return said


def _stopped(ready: Ready, mission: TeamDriven, number: int) -> tuple[float, float]:
    """How long a robot charged, and how long it stood at other stops [s]."""
    own, outcome = ready.orders[number], mission.robots[number]
    charged = stood = burnt = 0.0
    legs = mission.driven[number]
    waits = legs.waited_s
    for k, site in enumerate(mission.stops[number][1:outcome.stops_reached + 1]):
        burnt += float(legs.leg_s[k]) + own.idle_share * float(waits[k])
        if site in own.stations:
            charged += own.stop_s[site] + burnt / own.charge_rate.get(site, math.inf)
            burnt = 0.0
        else:
            stood += own.stop_s[site]
            burnt += own.idle_share * own.stop_s[site]
    return charged, stood
