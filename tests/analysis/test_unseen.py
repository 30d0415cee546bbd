"""What a draw that was not met could do, judged by how near those that were met came to it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import nct, norm

from sva_bench.analysis.unseen import EXECUTION_LOSSES, exposure_of, share_below
from sva_bench.execution.margins import Margins, margins_of, margins_of_team
from sva_bench.execution.outcome import Assignment, Driven

ORDERS = Assignment(
    robot="uv1", route=("base", "p1", "r1", "p2", "base"), stations=frozenset({"r1"}),
    incentives={"p1": 30.0, "p2": 50.0}, stop_s={"base": 0.0, "r1": 10.0, "p1": 2.0, "p2": 0.0}, fuel_capacity_s=20.0,
    mission_limit_s=60.0)


def driven(*leg_s: float, stuck: bool = False) -> Driven:
    return Driven(leg_s=np.array(leg_s), stuck=stuck, leg_of=np.empty(0), clock_s=np.empty(0), pose=np.empty((0, 3)))


def test_margins_by_hand() -> None:
    margins = margins_of(0, ORDERS, [driven(8, 9, 10, 9), driven(8, 13, 10)])
    assert margins.is_poi.tolist() == [True, False, True, False]
    assert margins.fills.tolist() == [False, True, False, False]
    assert margins.collected.tolist() == [0.0, 30.0, 80.0]
    # First draw: tank 12, 3, filled to 20: 10, 1. Clock 8 + 2, 19 + 10, 39, 48 of 60.
    assert margins.fuel_s[0].tolist() == [12.0, 3.0, 10.0, 1.0]
    assert margins.time_s[0].tolist() == [50.0, 31.0, 21.0, 12.0]
    # Second: dry before r1; the drive tells no more after its third leg.
    assert margins.fuel_s[1, :3].tolist() == [12.0, -1.0, 10.0]
    assert np.isnan(margins.fuel_s[1, 3])


def test_a_leg_that_a_robot_got_stuck_on_has_no_time() -> None:
    margins = margins_of(0, ORDERS, [driven(8, 40, stuck=True)])
    assert np.isnan(margins.leg_s[0]).tolist() == [False, True, True, True]


def test_a_team_has_margins_of_whole_routes_one_for_each_draw() -> None:
    home = Assignment(**{**ORDERS.__dict__, "robot": "uv2", "route": ()})
    drives = {("uv1", ORDERS.route, 1, 0): driven(8, 9, 10, 9), ("uv1", ORDERS.route, 0, 7): driven(7, 9, 10, 9),
              ("uv1", ORDERS.route[:2], 0, 8): driven(7)}  # cut off by a failure, under ``physics``
    (margins,) = margins_of_team([ORDERS, home], drives)
    assert margins.leg_s[:, 0].tolist() == [7.0, 8.0]
    (none,) = margins_of_team([ORDERS], {})
    assert none.leg_s.shape == (0, 4)
    # Nothing is known of a route that no trial had driven: all of its 80 may be lost, to any end.
    for noisy in (True, False):
        assert exposure_of([none], 1, noisy=noisy).value.tolist() == [80.0]
        assert exposure_of([none], 1, noisy=noisy).ends.tolist() == [[1.0, 1.0, 1.0]]


def test_the_share_below_is_bounded_as_tables_of_normal_tolerance_limits_have_it() -> None:
    # Odeh & Owen: what 8 draws 5 standard deviations off leave is the noncentral t's limit.
    rng = np.random.default_rng(0)
    left = rng.normal(size=(8, 1))
    left = 5 + (left - left.mean()) / left.std(ddof=1)
    share = float(share_below(left)[0])
    distance = norm.isf(share)
    assert nct.cdf(5 * np.sqrt(8), 7, distance * np.sqrt(8)) == pytest.approx(0.975, abs=1e-3)
    assert share == pytest.approx(0.0093, abs=5e-4)


def test_the_share_below_is_never_more_than_that_of_an_unseen_event_unless_it_was_seen() -> None:
    near, far, dry, never, endless = np.array([0.01, 0.2, 0.01, 0.3]), np.array([9.0, 9.1, 9.0, 9.1]), \
        np.array([5.0, -0.1, 5.0, 5.0]), np.full(4, 3.0), np.full(4, np.inf)
    shares = share_below(np.column_stack([near, far, dry, never, endless, [1.0, np.nan, 1.0, 1.0]]))
    assert shares[0] == pytest.approx(1 - 0.025 ** (1 / 4))
    assert shares[1:].tolist() == [0.0, 1.0, 0.0, 0.0, 1.0]
    assert share_below(np.ones((1, 1))).tolist() == [1 - 0.025]  # one draw tells nothing of others


@pytest.mark.parametrize("draws", [4, 8, 32])
@pytest.mark.parametrize("distance", [0.5, 1.5, 2.5])
def test_the_bound_holds_in_97_per_cent_of_normal_samples(draws: int, distance: float) -> None:
    rng = np.random.default_rng([draws, int(10 * distance)])
    bound = share_below(distance + rng.normal(size=(draws, 4000)))
    # Four standard deviations of a frequency of 0.975 in 4000: 0.01.
    assert np.mean(bound >= np.minimum(norm.sf(distance), 1 - 0.025 ** (1 / draws)) - 1e-12) >= 0.965


def exposed(drives: list[Driven], *, noisy: bool = True) -> tuple[float, dict[str, float]]:
    found = exposure_of([margins_of(0, ORDERS, drives)], 1, noisy=noisy)
    return float(found.value[0]), dict(zip(EXECUTION_LOSSES, found.ends[0].tolist(), strict=True))


def test_a_robot_that_is_far_from_every_end_has_nothing_to_lose() -> None:
    drives = [driven(8 + x, 9, 10, 5) for x in (0.0, 0.01, -0.01, 0.02)]
    assert exposed(drives) == (0.0, {"out_of_fuel": 0.0, "late": 0.0, "stuck": 0.0})


def test_only_what_comes_after_the_danger_can_be_lost() -> None:
    # r1 is reached on 0.2 s of fuel, more or less: p2 and the way home are at stake, p1 is not.
    drives = [driven(8 + x, 11.8, 10, 5) for x in (0.0, 0.19, -0.2, 0.18)]
    lost, ends = exposed(drives)
    assert lost == pytest.approx(50.0)
    assert (ends["out_of_fuel"], ends["stuck"]) == (1.0, 0.0)


def test_what_was_seen_counts_in_full() -> None:
    assert exposed([driven(8, 13, 10, 5)] + [driven(8, 9, 10, 5)] * 31)[0] == 50.0
    stuck = [driven(8, 9, 10, 5)] * 7 + [driven(8, 9, 40, stuck=True)]
    lost, ends = exposed(stuck)
    assert (lost, ends["stuck"]) == (50.0, 1.0)


def test_without_noise_a_single_drive_determines_the_shares() -> None:
    assert exposed([driven(8, 11.8, 10, 5)], noisy=False)[0] == 0.0
    assert exposed([driven(8, 12.5, 10, 5)], noisy=False)[0] == 50.0


def test_of_several_routes_of_one_robot_the_worst_counts() -> None:
    risky = margins_of(0, ORDERS, [driven(8, 13, 10, 5)])
    safe: Margins = margins_of(0, ORDERS, [driven(8, 9, 10, 5)])
    assert exposure_of([safe, risky], 2, noisy=False).value.tolist() == [50.0, 0.0]
