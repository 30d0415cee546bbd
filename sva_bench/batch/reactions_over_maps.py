"""What reacting is worth over maps, from the summaries of a batch's points and seeds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from sva_bench.analysis.over_maps import GainOverMaps, ReactionOverMaps, UnitSummary
from sva_bench.analysis.reaction_results import Gain, ReactionResult
from sva_bench.batch.map_samples import in_per_cent, over_maps, percentage_over_maps
from sva_bench.choices import News, PolicyName

_Key = tuple[str, str, PolicyName, News]
_ByMap = Mapping[str, Sequence[ReactionResult]]


def reactions_over_maps(units: Sequence[UnitSummary]) -> tuple[ReactionOverMaps, ...]:
    """Each reaction over maps, for each variant and scenario; as for the VSS, seeds are nested in maps."""
    found: dict[_Key, dict[str, list[ReactionResult]]] = {}
    doubtful: set[tuple[str, str]] = set()
    for unit in units:
        for scenario in unit.scenarios:
            if any(p < 1 for p in scenario.availability.values()):
                doubtful.add((unit.variant, scenario.name))
            for result in scenario.reactions or ():
                key = unit.variant, scenario.name, result.policy, result.news
                found.setdefault(key, {}).setdefault(unit.world, []).append(result)
    return tuple(_row(key, by_map, sure=key[:2] not in doubtful) for key, by_map in found.items())


def _row(key: _Key, by_map: _ByMap, *, sure: bool) -> ReactionOverMaps:
    variant, scenario, policy, news = key
    plans = next(iter(by_map.values()))[0].value_of_recourse

    def gain(read: Callable[[ReactionResult], Gain], whole: Callable[[ReactionResult], float]) -> GainOverMaps:
        found = over_maps([[read(seed) for seed in seeds] for seeds in by_map.values()], sure=sure)
        return GainOverMaps(mean=found.mean, ci95=found.ci95, pct=percentage_over_maps([
            [in_per_cent(each, each.pct, whole(seed)) for seed in seeds for each in (read(seed),)]
            for seeds in by_map.values()], sure=sure))

    return ReactionOverMaps(
        variant=variant, scenario=scenario, policy=policy, news=news, maps=len(by_map),
        vss=gain(vss_of, lambda result: result.plans["stochastic"].executed.mean),
        value_of_recourse={name: gain(_recourse_of(name), _kept_of(name)) for name in plans},
        vss_with_recourse=gain(lambda result: result.vss_with_recourse, _best),
        anticipation=gain(lambda result: result.anticipation, _best))


def _recourse_of(plan: str) -> Callable[[ReactionResult], Gain]:
    return lambda result: result.value_of_recourse[plan]


def _kept_of(plan: str) -> Callable[[ReactionResult], float]:
    """What a plan is worth if nobody reacts."""
    return lambda result: result.plans[plan].executed.mean - result.value_of_recourse[plan].mean


def _best(result: ReactionResult) -> float:
    return result.plans[result.best.plan].executed.mean


def vss_of(result: ReactionResult) -> Gain:
    """The executed VSS under a reaction."""
    found = result.vss.executed
    return Gain(mean=found.mean, ci95=found.ci95, pct=result.vss.executed_pct)
