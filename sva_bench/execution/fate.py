"""Fate: everything that chance decides about trials, drawn ahead and the same for whatever is compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sva_bench.arrays import FloatArray, IntArray, frozen, frozen_int
from sva_bench.execution.case import Settings
from sva_bench.execution.noise import NoiseDraw, draw_noise
from sva_bench.execution.outcome import RobotFate
from sva_bench.mission.failures import NEVER, FailureDraw, Failures, process_of
from sva_bench.world.model import Scenario, World


@dataclass(frozen=True, eq=False, kw_only=True)
class Fate:
    """What chance decides about a range of trials of one case.

    Attributes:
        fails: Number of the POI before which each robot fails, shape (trials, robots). 0: before it leaves the base;
            ``NEVER``: it doesn't fail so, or not within its route.
        lifetime_s: Driving time after which each robot fails [s], shape (trials, robots); ``inf`` = never.
        rollout: Noise draw of each trial, shape (trials,).
        noise: What differs about each robot, by noise draw and the robot's position in its team.
    """

    fails: IntArray
    lifetime_s: FloatArray
    rollout: IntArray
    noise: Mapping[tuple[int, int], NoiseDraw]

    def __post_init__(self) -> None:
        trials = len(self.rollout)
        object.__setattr__(self, "fails", frozen_int(self.fails, (trials, None)))
        object.__setattr__(self, "lifetime_s", frozen(self.lifetime_s, self.fails.shape))
        object.__setattr__(self, "rollout", frozen_int(self.rollout, (trials,)))

    def of(self, row: int, robot: int) -> RobotFate:
        """The fate of one robot in one trial."""
        return RobotFate(before_poi=int(self.fails[row, robot]), lifetime_s=float(self.lifetime_s[row, robot]))


def draw_fate(world: World, scenario: Scenario, pois: Sequence[int], settings: Settings) -> Fate:
    """Draw the fate of the trials in ``settings``: failures by trial, noise by rollout, each robot by itself.

    Args:
        world: The world: its robots, its noise, and the failure process executed.
        scenario: Availabilities.
        pois: Number of POIs on the route of each robot, length (robots,).
        settings: Seed, and which trials and rollouts.
    """
    rollout = (settings.first + np.arange(settings.trials)) % settings.rollouts
    failures = _failures(world, scenario, np.array(pois, dtype=np.int64), settings)
    return Fate(
        fails=failures.before_poi, lifetime_s=failures.lifetime_s, rollout=rollout,
        noise={(k, robot): draw_noise(world.noise, settings.seed, k, robot)
               for k in np.unique(rollout).tolist() for robot in range(len(world.robots))})


def _failures(world: World, scenario: Scenario, pois: IntArray, settings: Settings) -> Failures:
    drawn = process_of(world.execute_failure).draw(FailureDraw(
        seed=settings.seed, vehicles=tuple(robot.name for robot in world.robots), trials=settings.trials,
        first=settings.first, pois=int(pois.max(initial=0)), joint=scenario.joint,
        reliability=tuple(scenario.reliability(robot) for robot in world.robots)))
    # Draws for a longer route of another robot mean nothing to this one.
    return replace(drawn, before_poi=np.where(drawn.before_poi > pois, NEVER, drawn.before_poi))
