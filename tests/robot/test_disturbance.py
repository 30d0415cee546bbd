"""The error field of localisation: a Gaussian field, the same at the same place; and delays."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from sva_bench.arrays import FloatArray
from sva_bench.robot.disturbance import FEATURES, NO_WAVES, UNDISTURBED, Disturbance, ErrorField, error_at, room_for
from sva_bench.robot.follower import CONTROL_HZ
from sva_bench.robot.twin import delayed

FIELD = ErrorField(sd_m=0.05, sd_rad=math.radians(2.0), length_m=0.5, seed=(0, 12, 0, 0))


def field(number: int) -> ErrorField:
    return ErrorField(sd_m=0.05, sd_rad=math.radians(2.0), length_m=0.5, seed=(0, 12, number, 0))


def error_of(waves: FloatArray, x: float, y: float) -> tuple[float, float, float]:
    ex, ey, eyaw = error_at(waves, room_for(waves), x, y)
    return ex, ey, eyaw


@given(st.floats(-1000, 1000), st.floats(-1000, 1000), st.integers(0, 20))
def test_the_error_is_the_sum_of_its_waves(x: float, y: float, number: int) -> None:
    waves = field(number).waves()
    phase = (x, y) @ waves[:2]
    expected = [float(waves[k] @ np.cos(phase) + waves[k + 1] @ np.sin(phase)) for k in (2, 4, 6)]
    # The series is right to 1e-9 of an amplitude, and there are 24; turns far from the origin lose some digits.
    assert_allclose(error_of(waves, x, y), expected, atol=1e-9 + 1e-12 * FEATURES * (abs(x) + abs(y)))


def test_errors_have_the_spread_and_the_length_that_were_asked_for() -> None:
    # Over 400 fields at points 0, L and 5 L apart. The covariance of a squared exponential is exp(-1/2) at one length
    # and 4e-6 at five; the error of a correlation over 400 fields is 0.05, of a spread 3.5 %.
    waves = [field(k).waves() for k in range(400)]
    here, there, far = (np.array([error_of(w, 3.0 + d, 7.0) for w in waves]) for d in (0.0, 0.5, 2.5))
    assert_allclose(here.std(axis=0), [0.05, 0.05, math.radians(2)], rtol=0.12)
    assert_allclose(here.mean(axis=0), 0.0, atol=0.05 * 0.2)
    for axis in range(3):
        assert np.corrcoef(here[:, axis], there[:, axis])[0, 1] == pytest.approx(math.exp(-0.5), abs=0.15)
        assert np.corrcoef(here[:, axis], far[:, axis])[0, 1] == pytest.approx(0.0, abs=0.2)
    assert np.corrcoef(here[:, 0], here[:, 1])[0, 1] == pytest.approx(0.0, abs=0.2)  # axes err independently


def test_a_robot_that_believes_to_be_somewhere_stands_where_the_error_leads_there() -> None:
    for number in range(20):
        pose = (number * 0.7, -0.3 * number, 0.1 * number)
        x, y, yaw = field(number).start(pose)
        ex, ey, eyaw = error_of(field(number).waves(), x, y)
        assert_allclose((x + ex, y + ey, yaw + eyaw), pose, atol=1e-9)


def test_the_steepest_field_that_is_allowed_has_one_place_for_each_belief() -> None:
    # Its gradient has a standard deviation of 0.2: at 1, five of them, the iteration would not come to an end.
    worst = 0.0
    for number in range(200):
        steep = ErrorField(sd_m=0.2, sd_rad=0.0, length_m=1.0, seed=(1, number))
        x, y, _ = steep.start((2.0, 3.0, 0.0))
        ex, ey, _ = error_of(steep.waves(), x, y)
        worst = max(worst, math.hypot(x + ex - 2.0, y + ey - 3.0))
    assert worst < 1e-3


def test_fields_of_one_seed_are_equal_and_of_others_differ() -> None:
    assert_array_equal(field(3).waves(), field(3).waves())
    assert not np.array_equal(field(3).waves(), field(4).waves())
    assert not field(3).waves().flags.writeable


def test_an_undisturbed_robot_knows_where_it_is_and_obeys_at_once() -> None:
    assert UNDISTURBED.waves is NO_WAVES
    assert_array_equal(UNDISTURBED.start((1.0, 2.0, 3.0)), [1.0, 2.0, 3.0])
    assert UNDISTURBED.delay_steps == 0


def test_a_command_comes_out_as_many_steps_later_as_the_delay_has() -> None:
    assert Disturbance(delay_s=0.05).delay_steps == round(0.05 * CONTROL_HZ) == 3
    queue = np.zeros((3, 2))
    out = [delayed(queue, float(k), -float(k)) for k in range(1, 7)]
    assert out == [(0.0, 0.0)] * 3 + [(1.0, -1.0), (2.0, -2.0), (3.0, -3.0)]
    assert delayed(np.zeros((0, 2)), 5.0, 6.0) == (5.0, 6.0)
