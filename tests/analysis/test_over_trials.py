"""The ledger and the summary of two plans, by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import beta

from sva_bench.analysis.comparison import comparison_summary, ranking
from sva_bench.analysis.figures import difference_figure, end_figures, value_figure
from sva_bench.analysis.over_trials import (
    Judged,
    ScenarioTrials,
    charges,
    ledger,
    plan_result,
    promise_of,
    scenario_summary,
)
from sva_bench.analysis.results import Estimate, PlanResult, Ranked, ScenarioFacts, Share
from sva_bench.analysis.scenarios import ScenarioSummary
from sva_bench.analysis.statistics import bounded_mean, estimate
from sva_bench.choices import ENDS, End
from sva_bench.execution.case import Case
from sva_bench.execution.executed import Executed
from sva_bench.execution.margins import Margins
from sva_bench.files.records import as_dict
from sva_bench.mission.failures import Reliability, process_of
from sva_bench.mission.plan import Plan
from sva_bench.world.model import Scenario

ROBOTS = ("uv1", "uv2")
SCENARIO = Scenario(name="S2", availability={"uv1": 1.0, "uv2": 0.5})


def executed(incentive: list[list[float]], ends: list[list[End]], planned: list[float], *, promised: float | None,
             planner: str = "stochastic", rollouts: int = 2, near: bool = True) -> Executed:
    earned = np.array(incentive)
    end = np.array([[ENDS.index(e) for e in row] for row in ends], dtype=np.int64)
    zeros = np.zeros(earned.shape, dtype=np.int64)
    plan = Plan(routes={"uv1": ("base", f"by-{planner}", "base")}, value=promised, bound=promised, status="optimal")
    return Executed(
        case=Case(scenario=SCENARIO, planner=planner, plan=plan), robots=ROBOTS,
        rollout=np.arange(len(earned)) % rollouts, available=end != ENDS.index("failed"), incentive=earned,
        pois_reached=zeros, stops_reached=zeros, end=end, end_time_s=np.zeros(earned.shape),
        fuel_used_s=np.zeros(earned.shape), waited_s=np.zeros(earned.shape),
        lost=np.isin(end, [ENDS.index("out_of_fuel"), ENDS.index("stuck")]),
        contacts=zeros, planned_incentive=np.array(planned),
        drawn_value=np.where(end == ENDS.index("failed"), 0.0, np.array(planned)), value=earned,
        drawn_failed=end == ENDS.index("failed"),
        terms=process_of("mission").terms([Reliability(availability=p) for p in SCENARIO.availability.values()]),
        margins=tuple(route_of(m, f"{planner}-p{m}", worth, rollouts, near=near) for m, worth in enumerate(planned)),
        legs=(), traces=())


def route_of(robot: int, poi: str, worth: float, draws: int, *, near: bool) -> Margins:
    """A route of one POI; ``near`` running dry, so that noise may take all of it."""
    left = np.tile(np.linspace(0.0, 1e-3, draws)[:, None], (1, 2)) + (0 if near else 100)
    return Margins(robot=robot, route=("base", poi, "base"), is_poi=np.array([True, False]),
                   fills=np.array([False, False]), worth=np.array([worth, 0.0]), leg_s=np.ones((draws, 2)), fuel_s=left,
                   time_s=np.full((draws, 2), np.inf))


def ledger_of(judged: Judged, mean: float) -> dict[str, float]:
    run = judged.executed
    return as_dict(ledger(judged.promise, charges(run) / len(run.end), mean))


def result_of(judged: Judged) -> PlanResult:
    return plan_result(judged.promise, judged.executed, noisy=True)


def summary_of(
    stochastic: Judged, deterministic: Judged, *, modelled_range: tuple[float, float] | None, ws: float | None,
    evpi: float | None, vss_mean_value: float | None = 0.0, worst: Executed | None = None,
) -> ScenarioSummary:
    s, d = stochastic.executed, deterministic.executed
    facts = ScenarioFacts(
        name=SCENARIO.name, availability=SCENARIO.availability, modelled_range=modelled_range, ws=ws, evpi=evpi,
        vss_mean_value=vss_mean_value, value_of_process=None, same_plan=s.case.plan.drives_like(d.case.plan),
        plans={"stochastic": promise_of(s.case.plan, stochastic.expected),
               "deterministic": promise_of(d.case.plan, deterministic.expected)})
    return scenario_summary(facts, ScenarioTrials(stochastic=s, deterministic=d, worst=worst), noisy=True)


# Plans of 100 for uv1 and 60 for uv2, available in half of the missions: 130 expected, 140 promised by an optimist.
ENDED: list[list[End]] = [["home", "home"], ["home", "failed"], ["late", "out_of_fuel"], ["stuck", "home"]]
MIXED = executed([[100, 60], [100, 0], [70, 20], [40, 60]], ENDED, [100.0, 60.0], promised=140.0)
CLEAR = executed([[100, 60], [100, 0], [70, 20], [40, 60]], ENDED, [100.0, 60.0], promised=140.0, near=False)


def test_a_ledger_charges_each_loss_to_the_end_of_the_robot_that_planned_it() -> None:
    # Over four trials: out of fuel lost 60 - 20 = 40, late 100 - 70 = 30, stuck 100 - 40 = 60: 10, 7.5 and 15 each.
    # Executed: (160 + 100 + 90 + 100) / 4 = 112.5. Draws: the failure lost 60 / 4 = 15 where 30 were expected: +15.
    entries = ledger_of(Judged(expected=130.0, executed=MIXED), 112.5)
    assert entries == pytest.approx({"promised": 140.0, "assumption": -10.0, "draws": 15.0, "out_of_fuel": -10.0,
                                     "late": -7.5, "stuck": -15.0, "executed": 112.5})
    assert list(entries) == ["promised", "assumption", "draws", "out_of_fuel", "late", "stuck", "executed"]


def test_a_foreign_plan_that_promises_nothing_is_held_to_what_was_expected() -> None:
    silent = executed([[10, 0]], [["home", "home"]], [10, 0], promised=None)
    entries = ledger_of(Judged(expected=10.0, executed=silent), 10.0)
    assert entries["promised"] == 10.0
    assert entries["assumption"] == entries["draws"] == 0.0


def test_where_all_went_well_nothing_is_charged_and_nothing_is_minus_zero() -> None:
    happy = executed([[100, 60]] * 3, [["home", "home"]] * 3, [100, 60], promised=160.0)
    entries = ledger_of(Judged(expected=160.0, executed=happy), 160.0)
    assert [entries[k] for k in ("assumption", "draws", "out_of_fuel", "late", "stuck")] == [0.0] * 5
    assert "-0.0" not in str(entries)


def test_how_often_a_robot_fails_for_the_whole_mission_depends_on_no_noise_draw() -> None:
    # MIXED comes near to running dry: how else missions may end is open, but uv2's failures are those drawn.
    half = replace(MIXED, drawn_failed=MIXED.end == ENDS.index("failed"))
    along = replace(half, terms=replace(half.terms, survival=half.terms.share))
    told = estimate(end_figures(half, 1, noisy=True)["failed"])
    open_yet = estimate(end_figures(along, 1, noisy=True)["failed"])
    assert told.mean == open_yet.mean == 0.25
    assert told.ci95 is not None
    assert open_yet.ci95 is not None
    assert told.ci95 == pytest.approx((0.0063, 0.8059), abs=1e-3)  # Clopper and Pearson's for 1 of 4
    assert open_yet.ci95[0] < told.ci95[0]


figures = st.floats(0, 200)


@given(arrays(np.float64, (6, 2), elements=figures), arrays(np.int64, (6, 2), elements=st.integers(0, len(ENDS) - 1)),
       st.tuples(figures, figures), figures, figures)
def test_a_ledger_adds_up(earned: np.ndarray[tuple[int, int], np.dtype[np.float64]],
                          ends: np.ndarray[tuple[int, int], np.dtype[np.int64]], planned: tuple[float, float],
                          promised: float, expected: float) -> None:
    kept = np.minimum(earned, planned)
    run = replace(executed(kept.tolist(), [["home", "home"]] * 6, list(planned), promised=promised), end=ends)
    mean = float(kept.sum(axis=1).mean())
    entries = ledger_of(Judged(expected=expected, executed=run), mean)
    between = sum(entries[k] for k in ("assumption", "draws", "out_of_fuel", "late", "stuck"))
    # A sum of six figures below 1000 is exact to some 1e-12.
    assert entries["promised"] + between == pytest.approx(entries["executed"], abs=1e-9)
    assert entries["executed"] == mean
    assert all(entries[k] <= 0 for k in ("out_of_fuel", "late", "stuck"))


def test_a_plans_summary_by_hand() -> None:
    summary = result_of(Judged(expected=130.0, executed=MIXED))
    assert (summary.promised, summary.expected, summary.executed.mean) == (140.0, 130.0, 112.5)
    assert summary.by_robot == {"uv1": 77.5, "uv2": 35.0}
    assert summary.ends == {"home": 4, "failed": 1, "out_of_fuel": 1, "late": 1, "stuck": 1}
    assert summary.status == "optimal"
    # Draws left 160, 100, 160, 160 of the team, of 100 to 160: as shares of 60 they are 1, 0, 1, 1, and what is drawn
    # lies between B(0.025; 3, 2) and B(0.975; 4, 1). Noise took 0, 70 and 0, 60 of it: 35 and 30 under its two draws,
    # of at most 100 + 60 / 2 = 130.
    drawn = [100 + 60 * beta.ppf(0.025, 3, 2), 100 + 60 * beta.ppf(0.975, 4, 1)]
    taken = bounded_mean(2, 32.5, 12.5, (0.0, 130.0))
    low, high = 145 - drawn[0], drawn[1] - 145
    # Of the slack of 1e-3 s that the margins have, some thousandths of it are left.
    assert summary.executed.ci95 == pytest.approx((112.5 - np.hypot(low, taken[1] - 32.5),
                                                   112.5 + np.hypot(high, 32.5 - taken[0])), rel=1e-4)


def test_the_value_of_the_stochastic_solution_is_the_difference_of_paired_trials() -> None:
    other = executed([[90, 60], [90, 0], [60, 20], [30, 60]], ENDED, [90, 60], promised=150.0, planner="deterministic",
                     near=False)
    summary = summary_of(Judged(expected=130.0, executed=CLEAR), Judged(expected=120.0, executed=other),
                         modelled_range=(10.0, 25.0), ws=None, evpi=None)
    # Each trial is 10 better, whatever failures and noise do, and no draw came near to doing more: no spread.
    assert summary.vss.executed == Estimate(mean=10.0, ci95=(10.0, 10.0))
    assert summary.vss.distinguishable
    assert summary.vss.modelled == 10.0
    assert summary.vss.modelled_pct == pytest.approx(100 * 10 / 130)
    assert summary.vss.executed_pct == pytest.approx(100 * 10 / 112.5)
    assert summary.vss.modelled_range == (10.0, 25.0)
    assert summary.availability == {"uv1": 1.0, "uv2": 0.5}
    assert set(summary.plans) == {"stochastic", "deterministic"}
    assert summary.evpi is None


def test_equal_plans_are_not_distinguishable_and_per_cent_of_nothing_is_none() -> None:
    nothing = executed([[0, 0], [0, 0]], [["home", "failed"]] * 2, [0, 0], promised=0.0)
    twin = replace(nothing, case=replace(nothing.case, planner="deterministic"))
    summary = summary_of(Judged(expected=0.0, executed=nothing), Judged(expected=0.0, executed=twin),
                         modelled_range=None, vss_mean_value=None, ws=0.0, evpi=0.0)
    assert not summary.vss.distinguishable
    assert summary.vss.modelled_pct is None
    assert summary.vss.executed_pct is None
    assert summary.vss.modelled_range is None


def test_the_executed_range_goes_to_the_least_fortunate_of_the_tied_plans() -> None:
    other = executed([[90, 60], [90, 0], [60, 20], [30, 60]], ENDED, [90, 60], promised=150.0, planner="deterministic",
                     near=False)
    worst = replace(other, value=other.value - [5.0, 0.0])
    summary = summary_of(Judged(expected=130.0, executed=CLEAR), Judged(expected=120.0, executed=other), worst=worst,
                         modelled_range=(10.0, 15.0), ws=140.0, evpi=10.0)
    assert summary.vss.executed_range == pytest.approx((10.0, 15.0))
    assert summary.vss.verdict == "stochastic is worth more"
    assert (summary.ws, summary.evpi, summary.value_of_process) == (140.0, 10.0, None)


def test_ends_are_counted_by_robot_with_their_intervals() -> None:
    summary = result_of(Judged(expected=130.0, executed=MIXED))
    assert {end: found.share for end, found in summary.end_shares["uv1"].items()} == {
        "home": 0.5, "late": 0.25, "stuck": 0.25}
    low, high = summary.end_shares["uv1"]["late"].ci95 or (0.0, 0.0)
    assert 0 < low < 0.25 < high < 1
    assert summary.distribution.least == 90.0
    assert summary.distribution.cvar10 == 90.0


def test_an_end_that_cannot_happen_has_no_interval_to_speak_of() -> None:
    # uv1 is always available: it can't fail by draw, whatever noise does. uv2 never is: it can't run dry.
    certain = process_of("mission").terms([Reliability(availability=1.0), Reliability(availability=0.0)])
    run = executed([[100, 0]] * 8, [["home", "failed"]] * 8, [100.0, 60.0], promised=100.0, rollouts=8)
    figures = [end_figures(replace(run, terms=certain), m, noisy=True) for m in (0, 1)]
    assert estimate(figures[0]["failed"]).ci95 == (0.0, 0.0)
    assert estimate(figures[1]["failed"]).ci95 == (1.0, 1.0)
    assert estimate(figures[1]["out_of_fuel"]).ci95 == (0.0, 0.0)
    low, high = estimate(figures[0]["home"]).ci95 or (1.0, 1.0)
    assert low < high == 1.0  # near running dry


def test_one_trial_has_figures_and_no_intervals() -> None:
    one = executed([[100, 60]], [["home", "home"]], [100.0, 60.0], promised=140.0, rollouts=1)
    summary = result_of(Judged(expected=130.0, executed=one))
    assert summary.executed == Estimate(mean=160.0, ci95=None)
    assert summary.executed_controlled == Estimate(mean=130.0, ci95=None)
    assert summary.end_shares["uv2"] == {"home": Share(share=1.0, ci95=None)}
    assert summary.distribution.q50 == 160.0


@given(st.lists(st.sampled_from([("home", 60.0), ("failed", 0.0), ("out_of_fuel", 0.0)]), min_size=2, max_size=12),
       st.booleans())
def test_no_interval_goes_below_nothing_or_beyond_what_the_routes_hold(
        found: list[tuple[End, float]], noisy: bool) -> None:
    # Plan a sends both robots, uv1 to 100 and uv2 to 60; b sends uv1 alone, to 30 on another route.
    a = executed([[100, worth] for _, worth in found], [["home", end] for end, _ in found], [100, 60], promised=130)
    b = executed([[30, 0] for _ in found], [["home", end] for end, _ in found], [30, 0], promised=30, planner="b")
    for figure, (low, high) in ((value_figure(a, noisy=noisy), (0, 160)), (value_figure(b, noisy=noisy), (0, 30)),
                                (difference_figure(a, b, noisy=noisy), (-30, 160)),
                                (difference_figure(b, a, noisy=noisy), (-160, 30))):
        for got in (estimate(figure), estimate(figure, comparisons=3)):
            assert got.ci95 is None or low <= got.ci95[0] <= got.mean <= got.ci95[1] <= high
        assert figure.certain == (low, high)
    # One plan's own route is worth as much in both.
    assert difference_figure(a, a, noisy=noisy).certain == (0.0, 0.0)


def test_pairs_are_compared_by_simultaneous_intervals() -> None:
    def plan(name: str, worth: float) -> Judged:
        ends: list[list[End]] = [["home", "home" if there else "failed"] for there in (True, False) * 6]
        trials = executed([[10, worth if there else 0] for there in (True, False) * 6], ends, [10, worth],
                          promised=worth, planner=name)
        return Judged(expected=10 + worth / 2, executed=trials)

    # Half of twelve trials differ by 20: 20 times a share of 6 in 12, B(0.025; 6, 7) to B(0.975; 7, 6), for three pairs
    # with 0.05 / 6 to each side. c is worth as much as b.
    summary = comparison_summary([plan("b", 30), plan("a", 50), plan("c", 30)], ROBOTS, noisy=False)
    first = summary.comparisons[0]
    assert (first.a, first.b, first.mean) == ("b", "a", -10.0)
    assert first.ci95 == pytest.approx((-20 * beta.ppf(0.975, 7, 6), -20 * beta.ppf(0.025, 6, 7)))
    assert first.ci95_adjusted == pytest.approx((-20 * beta.ppf(1 - 0.05 / 6, 7, 6), -20 * beta.ppf(0.05 / 6, 6, 7)))
    assert [pair.verdict for pair in summary.comparisons] == [
        "a is worth more", "not distinguishable from zero", "a is worth more"]
    assert summary.ranking == (Ranked(rank=1, plan="a", mean=35.0), Ranked(rank=2, plan="b", mean=25.0),
                               Ranked(rank=2, plan="c", mean=25.0))


def test_plans_of_the_same_routes_are_one_plan_whatever_their_trials() -> None:
    once = executed([[10, 0], [20, 0]], [["home", "home"]] * 2, [20, 0], promised=20.0, planner="once")
    again = replace(once, case=replace(once.case, planner="again"))
    (pair,) = comparison_summary([Judged(expected=20.0, executed=once), Judged(expected=20.0, executed=again)],
                                 ROBOTS, noisy=False).comparisons
    assert pair.same_plan
    assert pair.verdict == "the same plan"
    plan = once.case.plan
    # A robot that isn't named stays home.
    assert plan.drives_like(replace(plan, routes={**plan.routes, "uv2": ()}, value=1.0))
    assert not plan.drives_like(replace(plan, routes={**plan.routes, "uv2": ("base", "p1", "base")}))


def test_one_plan_alone_has_a_rank_and_nothing_to_be_compared_with() -> None:
    assert ranking({"mine": 3.0}, []) == (Ranked(rank=1, plan="mine", mean=3.0),)
