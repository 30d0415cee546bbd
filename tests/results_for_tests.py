"""Results of a few figures, the others left at nothing."""

from __future__ import annotations

from collections.abc import Mapping

from sva_bench.analysis.over_maps import OverMaps, Percentage, UnitSummary
from sva_bench.analysis.results import (
    Distribution,
    Estimate,
    Ledger,
    PlanFigures,
    PlanResult,
    Vss,
    VssFigures,
)
from sva_bench.analysis.scenarios import ScenarioSummary, UnitScenario
from sva_bench.analysis.summaries import Failures, Reach, Summary, Travel

Interval = tuple[float, float]
NOTHING_MISSED = Reach(nothing=False, robots=(), pois=(), missed={})


def figures(mean: float, ci95: Interval | None = None, statistics: Mapping[str, Estimate] | None = None) -> PlanFigures:
    return PlanFigures(
        promised=mean, bound=mean, status="optimal", expected=mean, executed=Estimate(mean=mean, ci95=ci95),
        by_robot={"uv1": mean}, ends={"home": 1}, statistics=statistics or {},
        ledger=Ledger(promised=mean, assumption=0.0, draws=0.0, out_of_fuel=0.0, late=0.0, stuck=0.0, executed=mean))


def plan_result(mean: float) -> PlanResult:
    return PlanResult(
        **vars(figures(mean)), executed_controlled=Estimate(mean=mean, ci95=None), end_shares={"uv1": {}},
        distribution=Distribution(least=mean, q05=mean, q25=mean, q50=mean, q75=mean, q95=mean, greatest=mean,
                                  cvar10=mean))


def vss(mean: float, ci95: Interval | None = None, pct: float | None = None) -> VssFigures:
    executed = Estimate(mean=mean, ci95=ci95)
    return VssFigures(modelled=mean, modelled_pct=None, modelled_range=None, executed=executed, executed_pct=pct,
                      distinguishable=executed.excludes_zero, same_plan=False, verdict="")


def unit(world: str, mean: float, pct: float | None = None, availability: float = 0.5) -> UnitSummary:
    """A map under one seed."""
    scenario = UnitScenario(
        name="S", availability={"uv1": availability}, plans={"stochastic": figures(mean), "deterministic": figures(0)},
        vss=vss(mean, pct=pct), vss_mean_value=None, vss_mean_value_executed=None, ws=None, evpi=None,
        value_of_process=None)
    return UnitSummary(world=world, seed=0, trials=1, rollouts=1, fidelity="kinematic", variant="",
                       failure=Failures(plan="mission", execute="mission"), reproducible=True, reach=NOTHING_MISSED,
                       travel=Travel(pairs=0, triangle_violations_pct=0.0, max_excess_pct=0.0), scenarios=(scenario,))


def summary(ci95: Interval | None, mean: float, trials: int = 100, rollouts: int = 8) -> Summary:
    """A run of one scenario, by the interval of its executed VSS and the stochastic plan's mean."""
    middle = 0.0 if ci95 is None else sum(ci95) / 2
    scenario = ScenarioSummary(
        name="S", availability={"uv1": 0.5},
        plans={"stochastic": plan_result(mean), "deterministic": plan_result(mean - middle)},
        vss=Vss(**vars(vss(middle, ci95)), executed_range=None, executed_controlled=Estimate(mean=middle, ci95=None)),
        vss_mean_value=None, vss_mean_value_executed=None, ws=None, evpi=None, value_of_process=None)
    return Summary(world="w", seed=0, trials=trials, rollouts=rollouts, fidelity="kinematic",
                   failure=Failures(plan="mission", execute="mission"), reproducible=True, reach=NOTHING_MISSED,
                   travel=Travel(pairs=0, triangle_violations_pct=0.0, max_excess_pct=0.0), scenarios=(scenario,))


def over_maps(maps: int, ci95: Interval | None, pct: Interval | None = None) -> OverMaps:
    """A row over so many maps."""
    def middle(ends: Interval | None) -> float:
        return 1.0 if ends is None else sum(ends) / 2

    return OverMaps(variant="", scenario="S3", maps=maps, vss=Estimate(mean=middle(ci95), ci95=ci95),
                    vss_pct=Percentage(mean=middle(pct), ci95=pct))
