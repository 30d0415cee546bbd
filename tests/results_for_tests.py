"""Results of a few figures, the others left at nothing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from sva_bench.analysis.over_maps import OverMaps, Percentage, UnitSummary
from sva_bench.analysis.reaction_results import (
    BestPlan,
    DrivenWhole,
    Gain,
    ReactingPlan,
    ReactionLedger,
    ReactionResult,
)
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
from sva_bench.choices import HistoryMode, News

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


def reaction(news: News, values: Mapping[str, tuple[float, float]], half: float = 1.0, *, best: str = "stochastic",
             over: str | None = "deterministic", histories: HistoryMode = "enumerated", doubled: float = 0.0,
             same_plan: bool = False) -> ReactionResult:
    """A reaction by each plan's value without it and with it; all intervals are so wide to either side."""
    def around(mean: float) -> Estimate:
        return Estimate(mean=mean, ci95=(mean - half, mean + half))

    def gain(mean: float, of: float) -> Gain:
        return Gain(**vars(around(mean)), pct=100 * mean / of if of > 0 else None)

    kept = {name: without for name, (without, _) in values.items()}
    after = {name: value for name, (_, value) in values.items()}
    gap = after["stochastic"] - after["deterministic"]
    plans = {name: ReactingPlan(
        **{**vars(figures(value)), "executed": around(value), "ledger": ReactionLedger(
            promised=value, assumption=0.0, reaction=value - kept[name], draws=kept[name] - value, out_of_fuel=0.0,
            late=0.0, stuck=0.0, executed=value)},
        modelled=value, distribution=plan_result(value).distribution, end_shares={"uv1": {}}, missions=8, reacted=0.5,
        doubled=doubled) for name, value in after.items()}
    of = after["stochastic"]
    return ReactionResult(
        policy="resolve", news=news, histories=histories, plans=plans,
        vss=replace(vss(gap, around(gap).ci95, 100 * gap / of if of else None), same_plan=same_plan),
        driven_whole=DrivenWhole(missions=1, differing=0),
        value_of_recourse={name: gain(after[name] - kept[name], kept[name]) for name in after},
        vss_without_reaction=gain(kept["stochastic"] - kept["deterministic"], kept["stochastic"]),
        vss_with_recourse=gain(after[best] - after["deterministic"], after[best]),
        anticipation=gain(after[best] - after["stochastic"], after[best]),
        best=BestPlan(plan=best, over=over, mean=0.0 if over is None else after[best] - after[over],
                      ci95=None if over is None else around(after[best] - after[over]).ci95))


def over_maps(maps: int, ci95: Interval | None, pct: Interval | None = None) -> OverMaps:
    """A row over so many maps."""
    def middle(ends: Interval | None) -> float:
        return 1.0 if ends is None else sum(ends) / 2

    return OverMaps(variant="", scenario="S3", maps=maps, vss=Estimate(mean=middle(ci95), ci95=ci95),
                    vss_pct=Percentage(mean=middle(pct), ci95=pct))
