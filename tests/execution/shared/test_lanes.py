"""Legs cut into cells."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sva_bench.execution.shared.lanes import CELL_M, cell_at, cells_of, cut
from sva_bench.robot.follower import stretches
from sva_bench.robot.model import BUILT_IN
from sva_bench.robot.twin import drive

MODEL = BUILT_IN["turtlebot2"]
BENT = np.array([(0.0, 0.0), (3.0, 0.0), (3.0, 2.0), (6.0, 4.0)])


def test_a_leg_lasts_as_long_as_the_twin_drives_it_to_the_bit() -> None:
    leg = (stretches(BENT, 1.0), stretches(BENT[::-1].copy(), -2.0))
    course = [stretch for hop in leg for stretch in hop]
    time_s, _ = drive(MODEL, course, np.array([0.0, 0.0, 2.0]))
    assert cut(MODEL, leg, (0.0, 0.0, 2.0)).lasts_s == time_s


def test_cells_are_entered_when_the_twin_is_as_far_along() -> None:
    # Straight ahead the follower's arc is the way driven.
    leg = (stretches(np.array([(0.0, 0.0), (4.0, 0.0)]), 0.0),)
    found = cut(MODEL, leg, (0.0, 0.0, 0.0))
    _, poses = drive(MODEL, leg[0], np.zeros(3), traced=True)
    x_m = np.concatenate([[0.0], poses[:, 0]])
    steps = np.round(found.enter_s * 60).astype(int)
    number = np.arange(len(steps))
    assert (x_m[steps] >= CELL_M * number - 1e-9).all()
    assert (x_m[steps[1:] - 1] < CELL_M * number[1:]).all()
    assert_allclose(found.place_m[:, 0], CELL_M * (number + 0.5), atol=0.65 / 60)  # at most a control step beyond


@pytest.mark.parametrize("length_m", [0.0, 0.005, 0.1, 0.119, 0.121, 0.3, 1.0, 1.009, 1.02, 7.3])
def test_every_cell_of_a_leg_is_entered_and_near_where_the_twin_is(length_m: float) -> None:
    leg = (stretches(np.array([(0.0, 0.0), (length_m, 0.0)]), math.pi),)
    found = cut(MODEL, leg, (0.0, 0.0, 0.0))
    assert len(found.enter_s) == cells_of(length_m) == cell_at(length_m, cells_of(length_m)) + 1
    assert found.enter_s[0] == 0
    assert (np.diff(found.enter_s) > 0).all()
    assert found.enter_s[-1] < found.lasts_s
    assert abs(found.place_m[-1, 0] - length_m) < 0.08


def test_a_leg_that_never_ends_is_refused() -> None:
    stretch = stretches(np.array([(0.0, 0.0), (1.0, 0.0)]), math.nan)
    with pytest.raises(ValueError, match="never arrives"):
        cut(MODEL, (stretch,), (0.0, 0.0, 0.0))
