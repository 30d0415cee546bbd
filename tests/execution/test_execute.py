"""Plans executed over many trials: paired, reproducible, and true to their closed form."""

from __future__ import annotations

import multiprocessing
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from sva_bench.analysis.figures import value_figure
from sva_bench.analysis.statistics import estimate
from sva_bench.choices import ENDS, FailureProcess, Fidelity
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.execute import execute
from sva_bench.execution.executed import Executed
from sva_bench.execution.noise import draw_noise
from sva_bench.mission.certify import expected_value
from sva_bench.mission.failures import JointState, route_value
from sva_bench.mission.plan import Plan
from sva_bench.robot.disturbance import UNDISTURBED
from sva_bench.study.costs import instance_of
from sva_bench.world.model import Scenario, World
from sva_bench.world.noise import Noise
from tests.execution.conftest import Planned

ARRAYS = ("rollout", "available", "incentive", "pois_reached", "stops_reached", "end", "end_time_s", "fuel_used_s")
APART = Plan(routes={"uv1": ("base", "p1", "p4", "base"), "uv2": ("base", "p2", "r1", "p3", "base")})
SWAPPED = Plan(routes={"uv1": ("base", "p2", "p3", "base"), "uv2": ("base", "p1", "p4", "base")})
IDLE = Plan(routes={"uv2": ("base", "p1", "base")})


def run(planned: Planned, plans: Sequence[Plan], *, trials: int = 40, rollouts: int = 2, seed: int = 0,
        fidelity: Fidelity = "kinematic", world: World | None = None, scenario: Scenario | None = None,
        executor: ProcessPoolExecutor | None = None) -> list[Executed]:
    world = world or planned.world
    cases = [Case(scenario=scenario or world.scenarios[0], planner=str(k), plan=plan) for k, plan in enumerate(plans)]
    return execute(world, planned.costs, cases,
                   Settings(seed=seed, trials=trials, rollouts=rollouts, fidelity=fidelity), executor)


def assert_same(a: Executed, b: Executed) -> None:
    for name in ARRAYS:
        assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
    for mine, other in zip(a.traces, b.traces, strict=True):
        assert_array_equal(mine.time_s, other.time_s)
        assert_array_equal(mine.pose, other.pose)
        assert_array_equal(mine.fuel_s, other.fuel_s)
    assert [vars(leg) for leg in a.legs] == [vars(leg) for leg in b.legs]


def ends(done: Executed) -> set[str]:
    return {ENDS[k] for k in np.unique(done.end)}


def quiet(world: World, **changes: object) -> World:
    return replace(world, noise=Noise(), **changes)  # type: ignore[arg-type]


def test_all_plans_meet_the_same_failures(small: Planned) -> None:
    first, second = run(small, [APART, SWAPPED])
    assert_array_equal(first.available, second.available)
    assert first.available[:, 0].all()
    assert 0 < first.available[:, 1].mean() < 1
    # A robot that failed earns nothing, whatever its plan.
    for done in (first, second):
        assert np.all(done.incentive[~done.available] == 0)
        assert np.all((done.end == ENDS.index("failed")) == ~done.available)


def test_a_safer_scenario_fails_in_fewer_of_the_same_trials(small: Planned) -> None:
    half, safe = (run(small, [APART], scenario=s)[0] for s in small.world.scenarios)
    assert np.all(half.available <= safe.available)
    assert safe.available.all()


def test_a_plan_alone_fares_as_beside_others(small: Planned) -> None:
    alone, beside = run(small, [APART])[0], run(small, [SWAPPED, APART])[1]
    for name in ARRAYS:
        assert_array_equal(getattr(alone, name), getattr(beside, name))


def test_an_idle_robot_ends_home_in_every_trial(small: Planned) -> None:
    (done,) = run(small, [IDLE], scenario=Scenario(name="s", availability={"uv1": 0.3, "uv2": 1.0}))
    assert np.all(done.end[:, 0] == ENDS.index("home"))
    assert np.all(done.end_time_s[:, 0] == 0)
    assert np.all(done.incentive[:, 0] == 0)
    assert 0 < done.available[:, 0].mean() < 1
    assert_array_equal(done.planned_incentive, [0, 40])


def test_a_robot_that_never_leaves_is_never_driven(small: Planned) -> None:
    (done,) = run(small, [APART], scenario=Scenario(name="s", availability={"uv1": 1.0, "uv2": 0.0}))
    assert {leg.robot for leg in done.legs} == {"uv1"}
    assert np.all(done.end[:, 1] == ENDS.index("failed"))
    assert_array_equal(done.traces[1].time_s, [0])


def test_more_trials_never_change_the_first_ones(small: Planned) -> None:
    few, many = (run(small, [APART], trials=trials, rollouts=3)[0] for trials in (7, 60))
    for name in ARRAYS:
        assert_array_equal(getattr(few, name), getattr(many, name)[:7])


def test_seeds_differ(small: Planned) -> None:
    first, second = (run(small, [APART], seed=seed)[0] for seed in (0, 1))
    assert not np.array_equal(first.available, second.available)
    assert not np.array_equal(first.end_time_s[first.available[:, 0], 0], second.end_time_s[first.available[:, 0], 0])


def test_a_rollout_is_one_draw_of_noise(small: Planned) -> None:
    (done,) = run(small, [APART], trials=40, rollouts=4)
    assert_array_equal(done.rollout, np.arange(40) % 4)
    times = done.end_time_s[:, 0]
    assert len(set(times)) > 1
    for k in range(4):
        assert len(set(times[done.rollout == k])) == 1
    (calm,) = run(small, [APART], trials=40, rollouts=1, world=quiet(small.world))
    assert len(set(calm.end_time_s[:, 0])) == 1


def test_gains_are_keyed_by_rollout_and_robot_alone() -> None:
    noise = Noise(wheel_gain_sd=0.01)
    drawn = [draw_noise(noise, 0, rollout, robot).disturbance.wheel_gains
             for rollout in range(200) for robot in range(2)]
    assert len(set(drawn)) == 400
    # Four standard deviations of an average of 800 gains: 4 x 0.01 / sqrt(800) = 0.0015.
    assert np.mean(drawn) == pytest.approx(1.0, abs=0.0015)
    assert np.std(drawn) == pytest.approx(0.01, rel=0.1)  # 4 / sqrt(1600)
    assert draw_noise(Noise(), 0, 3, 1).disturbance == UNDISTURBED


def test_twin_and_physics_agree_within_one_per_cent(small: Planned) -> None:
    kinematic, rollout = (run(small, [APART], fidelity=fidelity)[0] for fidelity in ("kinematic", "rollout"))
    assert_array_equal(kinematic.available, rollout.available)
    assert_array_equal(kinematic.end, rollout.end)
    assert_array_equal(kinematic.incentive, rollout.incentive)
    assert_allclose(rollout.end_time_s, kinematic.end_time_s, rtol=0.01)  # the planning margin covers so much


def test_legs_are_told_as_planned_and_as_driven(small: Planned) -> None:
    (done,) = run(small, [APART], fidelity="kinematic", rollouts=1, world=quiet(small.world))
    costs = small.costs["turtlebot2"]
    told = [(leg.robot, leg.leg, leg.origin, leg.destination) for leg in done.legs]
    assert told == [(robot, k, a, b) for robot in ("uv1", "uv2") for k, (a, b) in enumerate(pairwise(
        APART.route(robot)))]
    for leg in done.legs:
        i, j = costs.times.sites.index(leg.origin), costs.times.sites.index(leg.destination)
        assert leg.planned_s == costs.repaired_ms[i, j] / 1000
        # Each leg begins where the one before ended: a centimetre and a hundredth of a radian from its site.
        assert leg.driven_s == pytest.approx(leg.planned_s, abs=0.1)


@pytest.mark.parametrize("fidelity", ["kinematic", "rollout"])
def test_without_noise_a_feasible_plan_ends_home(small: Planned, fidelity: Fidelity) -> None:
    # The least fuel and the least limit that the planner would allow: planned costs with their margin of 1 %.
    costs, world = small.costs["turtlebot2"], small.world
    sites, cost = costs.times.sites, costs.cost_s
    stops = {site.name: site.stop_s for site in world.sites}
    robots = []
    for robot in world.robots:
        tank, most, clock = 0.0, 0.0, 0.0
        for a, b in pairwise(APART.route(robot.name)):
            tank += cost[sites.index(a), sites.index(b)]
            most, clock = max(most, tank), clock + cost[sites.index(a), sites.index(b)] + stops[b]
            tank = 0.0 if b == "r1" else tank
        robots.append(replace(robot, fuel_capacity_s=most, mission_limit_s=clock))
    (done,) = run(small, [APART], rollouts=1, fidelity=fidelity, world=quiet(world, robots=tuple(robots)))
    assert ends(done) <= {"home", "failed"}
    assert np.all(done.end[done.available] == ENDS.index("home"))
    # With a tenth less fuel, or a tenth less time, it does not.
    dry = tuple(replace(r, fuel_capacity_s=0.9 * r.fuel_capacity_s) for r in robots)
    hurried = tuple(replace(r, mission_limit_s=0.9 * r.mission_limit_s) for r in robots)
    assert "out_of_fuel" in ends(run(small, [APART], rollouts=1, world=quiet(world, robots=dry))[0])
    assert "late" in ends(run(small, [APART], rollouts=1, world=quiet(world, robots=hurried))[0])


@pytest.mark.parametrize("process", ["mission", "per_leg"])
@pytest.mark.parametrize("plan", [APART, SWAPPED])
def test_the_executed_mean_is_the_closed_form(small: Planned, process: FailureProcess, plan: Plan) -> None:
    world = replace(small.world, execute_failure=process)
    availability = {"uv1": 0.9, "uv2": 0.6}
    (done,) = run(small, [plan], trials=20_000, rollouts=1, seed=5, world=quiet(world),
                  scenario=Scenario(name="s", availability=availability))
    expected = sum(route_value([robot.incentives[site] for site in plan.route(robot.name) if site in robot.incentives],
                               availability[robot.name], process) for robot in world.robots)
    totals = done.incentive.sum(axis=1)
    # Four standard errors rather than the 95 % interval, which misses one seed in twenty.
    half = 4 * totals.std() / np.sqrt(len(totals))
    assert totals.mean() == pytest.approx(expected, abs=half)
    found = estimate(value_figure(done, noisy=False))
    assert found.ci95 is not None
    assert found.ci95[0] < expected < found.ci95[1]  # holds for this seed


@pytest.mark.parametrize("process", ["mission", "per_leg", "hazard"])
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_the_executed_mean_value_is_the_closed_form_where_lost_robots_cost(
        small: Planned, process: FailureProcess, noise: float) -> None:
    robots = tuple(replace(robot, loss_cost=25.0, mtbf_s=60.0) for robot in small.world.robots)
    world = replace(small.world, execute_failure=process, robots=robots, noise=Noise(wheel_gain_sd=noise))
    scenario = Scenario(name="s", availability={"uv1": 0.9, "uv2": 0.6}, mtbf_s={"uv1": 60.0})
    (done,) = run(small, [APART], trials=20_000, rollouts=8 if noise else 1, seed=5, world=world, scenario=scenario)
    assert_array_equal(done.value, done.incentive - 25.0 * done.lost)
    expected = expected_value(replace(instance_of(world, small.costs, scenario), failure=process), APART)
    half = 4 * done.drawn_value.sum(axis=1).std() / np.sqrt(20_000)  # four standard errors
    assert done.drawn_value.sum(axis=1).mean() == pytest.approx(expected, abs=half)
    if not noise:  # the twin drives as planned, to a control step a leg
        assert done.value.sum(axis=1).mean() == pytest.approx(expected, abs=half + 0.05)
    figure = value_figure(done, noisy=bool(noise))
    found = estimate(figure)
    assert found.mean == pytest.approx(done.value.sum(axis=1).mean())
    assert found.ci95 is not None
    assert found.ci95[0] < found.mean < found.ci95[1]
    observed = (done.drawn_value if noise else done.value).sum(axis=1)  # without noise the drawn part is the whole
    assert figure.drawn_bounds[0] <= observed.min()
    assert observed.max() <= figure.drawn_bounds[1]


def test_a_trial_under_hazard_is_the_same_alone_and_among_many(small: Planned) -> None:
    world = replace(small.world, execute_failure="hazard")
    case = Case(scenario=small.world.scenarios[0], planner="a", plan=APART)
    settings = Settings(seed=0, trials=40, rollouts=4, fidelity="kinematic", recorded=False)
    (many,) = execute(world, small.costs, [case], settings)
    for trial in range(0, 40, 7):
        (one,) = execute(world, small.costs, [case], replace(settings, first=trial, trials=1))
        for name in (*ARRAYS, "value", "lost", "drawn_value", "drawn_failed"):
            of_many = getattr(many, name)[trial]
            assert_array_equal(getattr(one, name)[0], of_many, err_msg=name)


def test_a_joint_distribution_is_executed_as_drawn(small: Planned) -> None:
    joint = (JointState(probability=0.5, available=frozenset({"uv1"})),
             JointState(probability=0.5, available=frozenset({"uv2"})))
    (done,) = run(small, [APART], trials=400,
                  scenario=Scenario(name="s", availability={"uv1": 0.5, "uv2": 0.5}, joint=joint))
    assert_array_equal(done.available[:, 0], ~done.available[:, 1])
    assert done.available[:, 0].mean() == pytest.approx(0.5, abs=0.1)  # 4 sqrt(0.25 / 400)


def test_failures_along_the_route_keep_what_was_collected(small: Planned) -> None:
    world = quiet(replace(small.world, execute_failure="per_leg"))
    (done,) = run(small, [APART], trials=500, rollouts=1, world=world,
                  scenario=Scenario(name="s", availability={"uv1": 0.5, "uv2": 0.5}))
    # uv1 earns 10 at p1, then 40 at p4: 0, 10 or 50 in all.
    assert set(done.incentive[:, 0]) == {0.0, 10.0, 50.0}
    # uv2 refuels at r1 between p2 (30) and p3 (20): it fails there, having stopped twice.
    failed_later = (done.incentive[:, 1] == 30) & (done.end[:, 1] == ENDS.index("failed"))
    assert failed_later.any()
    assert np.all(done.stops_reached[failed_later, 1] == 2)
    assert np.all(done.end_time_s[failed_later, 1] > 0)


def test_a_robot_that_was_drawn_to_fail_beyond_its_last_poi_is_available(small: Planned) -> None:
    # uv2 has one POI in both plans; uv1's longer route in the second must not make uv2 unavailable.
    world = quiet(replace(small.world, execute_failure="per_leg"))
    scenario = Scenario(name="s", availability={"uv1": 1.0, "uv2": 0.5})
    longer = Plan(routes={"uv1": ("base", "p2", "p3", "p4", "base"), "uv2": ("base", "p1", "base")})
    alone, beside = run(small, [IDLE, longer], world=world, scenario=scenario, trials=100, rollouts=1)
    assert_array_equal(alone.incentive[:, 1], beside.incentive[:, 1])
    assert_array_equal(alone.available[:, 1], beside.available[:, 1])


def test_the_trace_is_that_of_the_first_trial(small: Planned) -> None:
    (done,) = run(small, [APART], fidelity="rollout", rollouts=1, trials=3,
                  scenario=small.world.scenarios[1])
    for number, trace in enumerate(done.traces):
        assert trace.time_s[-1] == pytest.approx(done.end_time_s[0, number])
        assert trace.outcome.incentive == done.incentive[0, number]
        assert np.all(np.diff(trace.time_s) > 0)
        base = small.world.sites[0]
        assert_array_equal(trace.pose[0], [base.x_m, base.y_m, base.heading_rad])
        assert np.hypot(trace.pose[-1, 0] - base.x_m, trace.pose[-1, 1] - base.y_m) < 0.02
        assert_array_equal(trace.planned[0], [base.x_m, base.y_m])


def test_workers_give_the_same_arrays_as_this_process(small: Planned) -> None:
    here = run(small, [APART, IDLE], fidelity="rollout", trials=6)
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as workers:
        there = run(small, [APART, IDLE], fidelity="rollout", trials=6, executor=workers)
    for a, b in zip(here, there, strict=True):
        assert_same(a, b)


def test_progress_counts_every_drive(small: Planned) -> None:
    told: list[tuple[int, int]] = []
    case = Case(scenario=small.world.scenarios[1], planner="s", plan=APART)
    execute(small.world, small.costs, [case, replace(case, planner="again")],
            Settings(seed=0, trials=9, rollouts=3, fidelity="kinematic"), None,
            lambda done, of: told.append((done, of)))
    assert told == [(k, 6) for k in range(1, 7)]  # two robots, three rollouts; the second case shares all drives
