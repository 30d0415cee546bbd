"""Plans by name, as pages and terminal show them: one that missed its share is never plainly called calibrated."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from sva_bench.analysis.results import ScenarioPlans
from sva_bench.analysis.scenarios import ScenarioSummary, UnitScenario
from sva_bench.files.printable import counted

_MISSED = "share not reached"


def shown_name(scenario: ScenarioPlans, plan: str) -> str:
    """The name of a plan in a scenario, marked where it goes by the name of calibrated and is not."""
    return f"{plan} ({_MISSED})" if _misses(scenario, plan) else plan


def shown_over(scenarios: Sequence[ScenarioPlans], plan: str) -> str:
    """The name of a plan over scenarios, as a legend has it: marked where it misses its share in any of them."""
    missing = [scenario.name for scenario in scenarios if _misses(scenario, plan)]
    if not missing:
        return plan
    where = "" if len(missing) == len(scenarios) else f" in {len(missing)} of {counted(len(scenarios), 'scenario')}" \
        if len(missing) > 2 else f" in {' and '.join(missing)}"
    return f"{plan} ({_MISSED}{where})"


class ShownNames:
    """Shown names by scenario and plan, for rows that hold nothing but names."""

    def __init__(self, scenarios: Iterable[ScenarioPlans]) -> None:
        self._scenarios = {scenario.name: scenario for scenario in scenarios}

    def of(self, scenario: str, plan: str) -> str:
        """As ``shown_name`` says."""
        return shown_name(self._scenarios[scenario], plan)


def _misses(scenario: ScenarioPlans, plan: str) -> bool:
    # Given plans may be called anything: what one is stands in the results of its scenario.
    found = scenario.calibration if isinstance(scenario, ScenarioSummary | UnitScenario) else None
    return plan == "calibrated" and found is not None and not found.reached
