"""What calibrated plans of a batch come to: what for, and a line for each scenario, on the terminal and on the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from sva_bench.analysis.calibration import Calibration
from sva_bench.analysis.over_maps import UnitSummary, labelled
from sva_bench.files.printable import counted
from sva_bench.report.calibration_page import share_pct
from sva_bench.report.wording import listed, per_cent

_MOST_NAMED = 4


def calibrated_over_maps(units: Sequence[UnitSummary]) -> list[str]:
    """What plans were calibrated for, then in how many worlds each scenario's reached it, and its price there.

    Nothing without calibrated plans.
    """
    # Plans don't depend on seeds, so a world counts once.
    found: dict[str, dict[str, Calibration]] = {}
    for unit in units:
        for scenario in unit.scenarios:
            if scenario.calibration is not None:
                found.setdefault(labelled(scenario.name, unit.variant), {})[unit.world] = scenario.calibration
    if not found:
        return []
    goal = share_pct(next(iter(next(iter(found.values())).values())))
    head = f"at most {goal} of missions that go wrong though nobody fails" if goal else "the greatest executed value"
    return [f"Plans were calibrated for {head}:", *(f"{label}: {_told(worlds)}" for label, worlds in found.items())]


def _told(worlds: Mapping[str, Calibration]) -> str:
    missing = [name for name, found in worlds.items() if not found.reached]
    reached = [found for found in worlds.values() if found.reached]
    price = _price(reached)
    if all(one.share is None for one in worlds.values()):
        return f"{counted(len(worlds), 'world')}{price}."
    where = f"{len(reached)} of {counted(len(worlds), 'world')}"
    named = missing if len(missing) <= _MOST_NAMED else [
        *missing[:_MOST_NAMED], f"{len(missing) - _MOST_NAMED} more"]
    missed = f" Not reached in {listed(named)}: the plans shown there are not calibrated." if missing else ""
    return f"reached in {where}{price}.{missed}"


def _price(reached: Sequence[Calibration]) -> str:
    """How much less calibrated plans promise than nominal ones, of worlds in which there is something to promise."""
    less = [100 * (1 - found.promised / found.nominal.promised) for found in reached if found.nominal.promised > 0]
    if not less:
        return ""
    mean = sum(less) / len(less)
    if abs(mean) < 0.05:
        return ", where plans promise as much as nominal ones"
    over = " on average" if len(less) > 1 else ""
    return f", where plans promise {per_cent(abs(mean))} {'less' if mean > 0 else 'more'} than nominal ones{over}"
