"""Failure processes: closed forms by hand, draws by law."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from sva_bench.mission.failures import NEVER, JointState, draw_failures, marginals, route_value

TRIALS = 20_000


def test_a_mission_failure_loses_the_whole_route() -> None:
    assert route_value([10, 20, 30], 0.25, "mission") == 15.0  # 0.25 x 60
    assert route_value([], 0.25, "mission") == 0.0


def test_a_failure_along_the_route_loses_what_lies_ahead() -> None:
    assert route_value([10, 20, 40], 0.5, "per_leg") == 15.0  # 5 + 5 + 5
    assert route_value([40, 20, 10], 0.5, "per_leg") == 26.25  # 20 + 5 + 1.25


@given(st.lists(st.floats(0, 100), max_size=8), st.floats(0, 1))
def test_per_leg_failure_never_pays_more_than_mission_failure(incentives: list[float], p: float) -> None:
    assert route_value(incentives, p, "per_leg") <= route_value(incentives, p, "mission") + 1e-9


@pytest.mark.parametrize("process", ["mission", "per_leg"])
def test_more_trials_leave_the_earlier_ones_as_they_are(process: str) -> None:
    few, many = (draw_failures(7, ["a", "b"], {"a": 0.6, "b": 0.9}, process,  # type: ignore[arg-type]
                               trials=n, pois=5) for n in (50, 500))
    assert_array_equal(few, many[:50])


def test_draws_of_a_robot_do_not_depend_on_the_others_or_the_scenario() -> None:
    both = draw_failures(7, ["a", "b"], {"a": 0.6, "b": 0.9}, "mission", trials=100, pois=3)
    alone = draw_failures(7, ["a"], {"a": 0.6}, "mission", trials=100, pois=3)
    assert_array_equal(both[:, 0], alone[:, 0])
    safer = draw_failures(7, ["a"], {"a": 0.8}, "mission", trials=100, pois=3)
    assert not np.any((safer == 0) & (alone == NEVER))  # common random numbers: more reliable fails in fewer trials


def test_the_share_of_failed_missions_is_one_minus_the_availability() -> None:
    fails = draw_failures(1, ["a", "b", "c"], {"a": 0.75, "b": 1.0, "c": 0.0}, "mission", trials=TRIALS, pois=3)
    assert set(np.unique(fails)) == {0, NEVER}
    # Four standard deviations of a frequency at p = 0.75: 4 sqrt(0.1875 / 20000) = 0.0122.
    assert np.mean(fails[:, 0] == NEVER) == pytest.approx(0.75, abs=0.0123)
    assert np.all(fails[:, 1] == NEVER)
    assert np.all(fails[:, 2] == 0)


def test_the_poi_before_which_a_robot_fails_is_geometric() -> None:
    fails = draw_failures(1, ["a"], {"a": 0.6}, "per_leg", trials=TRIALS, pois=4)[:, 0]
    for k in range(1, 5):  # P(k) = s^(k-1) (1 - s); 4 sqrt(0.25 / 20000) = 0.0141 covers every frequency
        assert np.mean(fails == k) == pytest.approx(0.6 ** (k - 1) * 0.4, abs=0.0142)
    assert np.mean(fails == NEVER) == pytest.approx(0.6**4, abs=0.0142)


def test_the_mean_reward_of_a_route_is_its_closed_form() -> None:
    incentives = np.array([10.0, 20.0, 5.0])
    fails = draw_failures(3, ["a"], {"a": 0.7}, "per_leg", trials=TRIALS, pois=3)[:, 0]
    earned = [incentives[:min(int(k) - 1, 3)].sum() for k in fails]
    # Standard deviation of the earnings is below 35 / 2; four of them over sqrt(20000): 0.5.
    assert np.mean(earned) == pytest.approx(route_value(incentives.tolist(), 0.7, "per_leg"), abs=0.5)


def test_a_joint_distribution_replaces_the_independent_draws() -> None:
    joint = [JointState(probability=0.3, available=frozenset({"a", "b"})),
             JointState(probability=0.7, available=frozenset())]
    fails = draw_failures(2, ["a", "b"], {"a": 0.3, "b": 0.3}, "mission", trials=TRIALS, pois=3, joint=joint)
    assert_array_equal(fails[:, 0], fails[:, 1])
    assert np.mean(fails[:, 0] == NEVER) == pytest.approx(0.3, abs=0.0131)  # 4 sqrt(0.21 / 20000)
    assert marginals(joint, ["a", "c"]) == {"a": 0.3, "c": 0.0}
