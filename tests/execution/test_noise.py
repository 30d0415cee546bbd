"""Noise sources and fates: each drawn from its own stream, whatever else is drawn."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
from numpy.testing import assert_array_equal

from sva_bench.execution.case import Settings
from sva_bench.execution.fate import draw_fate
from sva_bench.execution.noise import SOURCES, NoiseDraw, draw_noise
from sva_bench.mission.failures import NEVER
from sva_bench.seeds import Stream, rng_for
from sva_bench.world.model import Scenario
from sva_bench.world.noise import REALISTIC, Noise
from tests.recording.missions import WORLD


def test_every_key_of_noise_has_a_source_and_no_two_share_a_stream() -> None:
    quiet, loud = Noise(), replace(REALISTIC, capacity_fade=(0.0, 0.2), payload_kg=(1.0, 5.0))
    of_draws = {field.name for field in fields(Noise)} - {"people", "hull_friction"}
    assert of_draws == {name for source in SOURCES.values() for name in of_draws
                        if getattr(source.silenced(loud), name) == getattr(quiet, name)}
    assert len({source.stream for source in SOURCES.values()}) == len(SOURCES)


def test_a_world_without_noise_disturbs_nobody() -> None:
    assert all(source.silent(Noise()) for source in SOURCES.values())
    assert draw_noise(Noise(), 0, 5, 1) == NoiseDraw()


def test_wheel_gains_are_the_first_two_normals_of_their_stream() -> None:
    left, right = (1.0 + 0.02 * rng_for(7, Stream.NOISE, 3, 1).standard_normal(2)).tolist()
    assert draw_noise(Noise(wheel_gain_sd=0.02), 7, 3, 1).disturbance.wheel_gains == (left, right)


def test_a_fate_is_the_same_for_a_range_of_trials_and_for_all_of_them() -> None:
    world = replace(WORLD, execute_failure="per_leg", noise=Noise(wheel_gain_sd=0.01))
    scenario = Scenario(name="s", availability={"uv1": 0.5, "uv2": 0.7, "uv3": 1.0})
    settings = Settings(seed=3, trials=40, rollouts=4, fidelity="kinematic")
    whole = draw_fate(world, scenario, [2, 1, 2], settings)
    part = draw_fate(world, scenario, [2, 1, 2], replace(settings, first=10, trials=20))
    assert_array_equal(part.fails, whole.fails[10:30])
    assert_array_equal(part.rollout, whole.rollout[10:30])
    assert part.noise == whole.noise
    assert set(whole.noise) == {(k, robot) for k in range(4) for robot in range(3)}
    # No robot fails beyond its own route, and the one that is always available never.
    assert set(np.unique(whole.fails[:, 1])) <= {1, NEVER}
    assert (whole.fails[:, 2] == NEVER).all()
