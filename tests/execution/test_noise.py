"""Noise sources and fates: each drawn from its own stream, whatever else is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from sva_bench.choices import NoiseName
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


# Each source by itself

LOUD = replace(REALISTIC, wheel_gain_sd=0.01, capacity_fade=(0.0, 0.2), payload_kg=(1.0, 5.0))
sources = pytest.mark.parametrize("name", sorted(SOURCES))
others = st.lists(st.sampled_from(sorted(SOURCES)), unique=True)


def only(name: str) -> Noise:
    """``LOUD`` with one source alone."""
    return without(LOUD, [other for other in SOURCES if other != name])


def without(noise: Noise, names: Sequence[NoiseName]) -> Noise:
    for name in names:
        noise = SOURCES[name].silenced(noise)
    return noise


@sources
def test_a_silenced_source_is_silent_and_nothing_else_is_changed(name: NoiseName) -> None:
    source = SOURCES[name]
    assert not source.silent(LOUD)
    assert source.silent(source.silenced(LOUD))
    assert all(not other.silent(source.silenced(LOUD)) for key, other in SOURCES.items() if key != name)
    assert source.silenced(source.silenced(LOUD)) == source.silenced(LOUD)


@sources
def test_a_source_alone_acts_and_differs_from_rollout_to_rollout_robot_to_robot_and_seed_to_seed(name: NoiseName
                                                                                                 ) -> None:
    draws = [draw_noise(only(name), seed, rollout, robot)
             for seed, rollout, robot in ((0, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 0))]
    calm = draw_noise(Noise(hull_friction=LOUD.hull_friction), 0, 0, 0)
    assert calm not in draws
    assert len(set(draws)) == len(draws)


@given(st.integers(0, 2**63 - 1), st.integers(0, 1000), st.integers(0, 5), others)
def test_what_a_source_draws_depends_on_no_other_source(seed: int, rollout: int, robot: int, silenced: list[NoiseName]
                                                        ) -> None:
    # Wheels and speed act on one figure, so they are told apart by their product.
    drawn, alone = draw_noise(without(LOUD, silenced), seed, rollout, robot), {
        name: draw_noise(only(name), seed, rollout, robot) for name in SOURCES}
    acting = set(SOURCES) - set(silenced)

    def of(name: NoiseName) -> NoiseDraw:
        return alone[name] if name in acting else NoiseDraw()

    assert drawn.capacity == of("capacity").capacity
    keys: dict[NoiseName, str] = {"track": "track_gain", "localisation": "field", "delay": "delay_s",
                                  "payload": "payload_kg"}
    for name, key in keys.items():
        assert getattr(drawn.disturbance, key) == getattr(of(name).disturbance, key)
    common = of("speed").disturbance.wheel_gains[0]
    assert drawn.disturbance.wheel_gains == tuple(gain * common for gain in of("wheels").disturbance.wheel_gains)


def test_sources_have_the_spread_that_is_asked_for() -> None:
    # 2000 draws: standard deviations are right to 1.6 %, means to 2.2 % of a standard deviation.
    draws = [draw_noise(LOUD, 0, rollout, 0) for rollout in range(2000)]
    gains = np.array([draw_noise(only("speed"), 0, k, 0).disturbance.wheel_gains[0] for k in range(2000)])
    assert gains.mean() == pytest.approx(1.0, abs=0.002)
    assert gains.std() == pytest.approx(0.02, rel=0.06)
    track = np.array([drawn.disturbance.track_gain for drawn in draws])
    assert track.std() == pytest.approx(0.02, rel=0.06)
    for values, (low, high) in (([d.disturbance.delay_s for d in draws], LOUD.delay_s),
                                ([d.disturbance.payload_kg for d in draws], LOUD.payload_kg)):
        assert low <= min(values) < low + 0.01 * (high - low)
        assert high - 0.01 * (high - low) < max(values) <= high
    fresh = [draw_noise(replace(LOUD, capacity_fade=(0.0, 0.0)), 0, k, 0).capacity for k in range(2000)]
    assert np.std(fresh) == pytest.approx(0.03, rel=0.06)
    # A normal factor of 1 +- 0.03 less a uniform share of 0 to 20 %.
    assert np.mean([d.capacity for d in draws]) == pytest.approx(0.9, abs=0.005)
    assert np.std([d.capacity for d in draws]) == pytest.approx(np.hypot(0.03 * 0.9, 0.2 / 12**0.5), rel=0.06)


@pytest.mark.long
def test_however_unlikely_a_draw_is_a_robot_has_wheels_and_a_tank() -> None:
    wild = replace(LOUD, wheel_gain_sd=0.2, speed_gain_sd=0.2, track_gain_sd=0.2, capacity_sd=0.2,
                   capacity_fade=(0.95, 0.95))
    draws = [draw_noise(wild, 0, rollout, 0) for rollout in range(20_000)]
    assert min(min(d.disturbance.wheel_gains) for d in draws) >= 0.2 * 0.2  # each wheel's own, and the common one
    assert min(d.disturbance.track_gain for d in draws) >= 0.2
    assert min(d.capacity for d in draws) == 0.05


def test_the_same_draw_is_the_same_object_of_data_whoever_asks() -> None:
    first = draw_noise(LOUD, 3, 5, 1)
    draw_noise.cache_clear()
    again = draw_noise(replace(LOUD), 3, 5, 1)
    assert again == first
    assert hash(again) == hash(first)  # hops are found by it
