"""Plans from anywhere, compared pair by pair and ranked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np

from sva_bench.analysis.figures import difference_figure
from sva_bench.analysis.moments import Figure
from sva_bench.analysis.over_trials import Judged, plan_result, totals, verdict_of
from sva_bench.analysis.results import Comparison, GivenPlanResult, Ranked
from sva_bench.analysis.scenarios import ComparedScenario
from sva_bench.analysis.statistics import estimate
from sva_bench.execution.executed import Executed


def comparison_summary(plans: Sequence[Judged], robots: Sequence[str], *, noisy: bool) -> ComparedScenario:
    """The summary of one scenario in which given plans were executed: every pair is compared, trial by trial.

    A pair is distinguishable where the simultaneous interval excludes zero.
    """
    scenario = plans[0].executed.case.scenario
    pairs = list(combinations([judged.executed for judged in plans], 2))
    comparisons = [_comparison(a, b, len(pairs), noisy=noisy) for a, b in pairs]
    return ComparedScenario(
        name=scenario.name, availability={name: scenario.availability[name] for name in robots},
        plans={judged.executed.case.planner: GivenPlanResult(
            **vars(plan_result(judged.promise, judged.executed, noisy=noisy)), feasible=judged.feasible,
            lost=int(judged.executed.lost.sum())) for judged in plans},
        comparisons=tuple(comparisons),
        ranking=ranking({p.executed.case.planner: float(np.mean(totals(p.executed))) for p in plans}, comparisons))


def _comparison(a: Executed, b: Executed, pairs: int, *, noisy: bool) -> Comparison:
    return comparison_of(difference_figure(a, b, noisy=noisy), (a.case.planner, b.case.planner), pairs,
                         same=a.case.plan.drives_like(b.case.plan))


def comparison_of(difference: Figure, names: tuple[str, str], pairs: int, *, same: bool) -> Comparison:
    """The comparison of two plans.

    Args:
        difference: Value of the first less that of the second.
        names: What they go by.
        pairs: Number of pairs whose intervals hold simultaneously.
        same: Whether they have the same routes.
    """
    single, simultaneous = estimate(difference), estimate(difference, comparisons=pairs)
    return Comparison(a=names[0], b=names[1], mean=single.mean, ci95=single.ci95, ci95_adjusted=simultaneous.ci95,
                      distinguishable=simultaneous.excludes_zero, same_plan=same,
                      verdict=verdict_of(simultaneous, *names, same=same))


def ranking(means: Mapping[str, float], comparisons: Sequence[Comparison]) -> tuple[Ranked, ...]:
    """Plans from best to worst; a plan's rank is one more than the number of plans that are distinguishably better."""
    better = dict.fromkeys(means, 0)
    for pair in comparisons:
        if pair.distinguishable:
            better[pair.b if pair.mean > 0 else pair.a] += 1
    return tuple(Ranked(rank=better[name] + 1, plan=name, mean=mean + 0.0)
                 for name, mean in sorted(means.items(), key=lambda item: (better[item[0]], -item[1])))
