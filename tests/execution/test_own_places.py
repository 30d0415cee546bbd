"""Robots that meet stand at berths and slots of their own, and drive from there what was planned from there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sva_bench.execution.drives import pose_at
from sva_bench.execution.twin_draws import TwinDraws
from sva_bench.study.costs import grounds_of, plan_costs
from sva_bench.world.noise import Noise
from tests.worlds_for_tests import SMALL, world_of

SHARED = SMALL.replace("stop_s: 4}", "stop_s: 4, slots: 2}") + "interaction: shared\n"


@pytest.mark.parametrize("interaction", ["independent", "uncoordinated", "shared"])
def test_robots_stand_where_their_own_world_has_its_sites(interaction: str, tmp_path: Path) -> None:
    world = world_of(tmp_path, SHARED.replace("shared", interaction))
    costs, grounds = plan_costs(world, "prmstar", lambda *_: None), grounds_of(world)
    for robot in world.robots:
        kind = world.kind_of(robot)
        for site in grounds[kind].world.sites:
            assert_allclose(pose_at(world, costs[kind], site.name), (site.x_m, site.y_m, site.heading_rad), atol=1e-9)
    apart = pose_at(world, costs[world.kind_of(world.robots[0])], "r1"), pose_at(
        world, costs[world.kind_of(world.robots[1])], "r1")
    assert (apart[0] != apart[1]) == (interaction != "independent")


def test_without_noise_the_twin_drives_each_leg_in_its_planned_time(tmp_path: Path) -> None:
    # Planned times are in milliseconds, so each of the few hops of a leg may be off by half of one.
    world = replace(world_of(tmp_path, SHARED), noise=Noise())
    costs = plan_costs(world, "prmstar", lambda *_: None)
    names = tuple(site.name for site in world.sites)
    for robot in world.robots:
        driven = TwinDraws(world, costs, 0, None).legs(robot.name, names, 1).driving_s[0]
        planned = costs[robot.name].repaired_ms / 1000
        off = ~np.eye(len(names), dtype=bool)
        assert_allclose(driven[off], planned[off], atol=2e-3)
