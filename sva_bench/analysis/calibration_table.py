"""``calibration.csv``: a row for each plan that was tried, and for the plan chosen and the nominal one as reported."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from sva_bench.analysis.calibration import Calibration, PlanJudged
from sva_bench.analysis.results import ScenarioPlans
from sva_bench.analysis.scenarios import ScenarioSummary, UnitScenario

CALIBRATION_COLUMNS = ("scenario", "draws_for", "quantile", "factor", "promised", "executed", "bad", "bad_low",
                       "bad_high", "draws", "chosen", "reached")
"""``draws_for`` tells which noise draws a row is of: ``choice`` or ``report``."""


def calibration_rows(scenarios: Iterable[ScenarioPlans]) -> list[list[object]]:
    """The rows of some scenarios; none where no plan was calibrated."""
    rows: list[list[object]] = []
    for scenario in scenarios:
        if isinstance(scenario, ScenarioSummary | UnitScenario) and (found := scenario.calibration) is not None:
            rows += [[scenario.name, *row] for row in _rows(found)]
    return rows


def _rows(found: Calibration) -> Iterable[list[object]]:
    for tried in found.curve:
        yield ["choice", tried.quantile, tried.factor, *_judged(tried), tried.draws, tried == found.chosen,
               found.reached]
    reported: Sequence[tuple[float | None, float, PlanJudged]] = (
        (found.quantile, found.factor, PlanJudged(promised=found.promised, executed=found.executed, bad=found.bad)),
        (None, 1.0, found.nominal))
    for number, (quantile, factor, judged) in enumerate(reported):
        yield ["report", quantile, factor, *_judged(judged), found.draws, number == 0, found.reached]


def _judged(plan: PlanJudged) -> list[object]:
    return [plan.promised, plan.executed, plan.bad.share, *(plan.bad.ci95 or (None, None))]
