"""Speed of teams that react: the whole run by phase, trials sampled, histories enumerated, and a state decided before.

Processor time is told, for a shared machine. Run: ``python benchmarks/reactions.py [WORLD ...]``.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from sva_bench.execution import plays
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.policies.policy import Orders, TeamState
from sva_bench.execution.policies.resolve import Resolve
from sva_bench.execution.react import Reacted, react
from sva_bench.mission.rest import Rest
from sva_bench.solver.rest import plan_rest
from sva_bench.solver.two_stage import plan_stochastic
from sva_bench.study import publish
from sva_bench.study.costs import instance_of, plan_costs
from sva_bench.study.libraries import load_libraries
from sva_bench.study.options import Options
from sva_bench.study.run import measure
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.load import load_world
from sva_bench.world.model import World

WORLDS = Path(__file__).parents[1] / "worlds"
TRIALS, ROLLOUTS = 10_000, 8
SURVIVAL = 0.9
"""Of every robot, before each POI: nothing is certain, so histories are many."""
ASKED = 10_000


@contextmanager
def _processor_time(watch: publish.Stopwatch, name: str) -> Iterator[None]:
    begun = time.process_time()
    yield
    watch.seconds[name] = watch.seconds.get(name, 0.0) + time.process_time() - begun


@dataclass(eq=False, kw_only=True)
class Counted:
    """Rests that were planned, and the time that they took [s]."""

    rests: int = 0
    seconds: float = 0.0

    def plan(self, rest: Rest) -> Mapping[str, tuple[str, ...] | None]:
        """Plan a rest."""
        begun = time.process_time()
        found = plan_rest(rest)
        self.rests += 1
        self.seconds += time.process_time() - begun
        return found


class Heard:
    """A policy that keeps the states that it was asked about."""

    def __init__(self, policy: Resolve) -> None:
        self._policy, self.states = policy, list[TeamState]()

    def __call__(self, state: TeamState) -> Orders:
        """The policy's orders."""
        self.states.append(state)
        return self._policy(state)


def whole_run(name: str) -> None:
    """Print the processor time of a whole run with reactions, phase by phase."""
    # Phases are told in wall-clock time to users.
    publish.Stopwatch.phase = _processor_time  # type: ignore[assignment,method-assign]
    begun = time.process_time()
    done = measure(load_world(WORLDS / f"{name}.yaml"), Options(
        rollouts=ROLLOUTS, policies=("none", "resolve"), news=("report", "instant"), anticipate=True), None,
        lambda *_: None)
    phases = ", ".join(f"{phase} {seconds:.1f} s" for phase, seconds in done.clock.seconds.items())
    print(f"{name}: run with two kinds of news and plans for them, in one process: processor "
          f"{time.process_time() - begun:.1f} s ({phases}); target 120 s on two cores", flush=True)


def uncertain(name: str) -> World:
    """A world of one scenario in which every robot may fail before each POI."""
    world = load_world(WORLDS / f"{name}.yaml")
    sure = {robot.name: SURVIVAL for robot in world.robots}
    return replace(world, execute_failure="per_leg", plan_failure="per_leg",
                   scenarios=(replace(world.scenarios[0], availability=sure, joint=None),))


def played(
    world: World, costs: Mapping[str, FuelCosts], cases: Sequence[Case], policy: Heard, most: int
) -> tuple[Reacted, float]:
    """The last case played without what was driven before, and the processor time of it [s]."""
    before, plays.MOST_HISTORIES = plays.MOST_HISTORIES, most
    begun = time.process_time()
    found = react(world, costs, cases, [policy] * len(cases), Settings(
        seed=0, trials=TRIALS, rollouts=ROLLOUTS, fidelity="kinematic", recorded=False))[-1]
    plays.MOST_HISTORIES = before
    return found, time.process_time() - begun


def trials_and_histories(name: str) -> None:
    """Print how long trials and histories of a world take where every state is new, and where all are known."""
    world = uncertain(name)
    costs = plan_costs(world, "prmstar", lambda *_: None)
    instance = replace(instance_of(world, costs, world.scenarios[0]), failure="per_leg")
    case = Case(scenario=world.scenarios[0], planner="stochastic", plan=plan_stochastic(instance), policy="resolve",
                news="report")
    for what, most, target_s in ((f"{TRIALS} trials sampled", 0, 20), ("all histories", 1 << 40, 10)):
        counted = Counted()
        policy = Heard(Resolve(instance, counted.plan))
        found, first_s = played(world, costs, [case], policy, most)
        _, again_s = played(world, costs, [case], policy, most)
        mean = float(found.weight @ found.value.sum(axis=1))
        print(f"{name}: {what} ({len(found.rollout)} rows, mean {mean:.1f}): processor {first_s:.1f} s, target "
              f"{target_s} s; of it {counted.rests} rests planned {counted.seconds:.1f} s; with all states known "
              f"{again_s:.2f} s", flush=True)
    begun = time.process_time()
    for number in range(ASKED):
        policy(policy.states[number % len(policy.states)])
    print(f"{name}: a known state is answered in {1e6 * (time.process_time() - begun) / ASKED:.1f} us, target 50 us")


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser()
    parser.add_argument("worlds", nargs="*", default=["four-rooms", "three-robots"])
    told = parser.parse_args()
    load_libraries()
    for name in told.worlds:
        whole_run(name)
        trials_and_histories(name)


if __name__ == "__main__":
    main()
