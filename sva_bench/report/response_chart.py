"""The response figures of a batch: what plans are worth over the values of a varied key, a small chart a scenario."""

from __future__ import annotations

from sva_bench.analysis.compared_values import KeyComparison, ValueRow, numbers_of, shown_value
from sva_bench.analysis.over_maps import labelled
from sva_bench.analysis.results import Estimate
from sva_bench.report.panels import Axes, Panel, Point, panels
from sva_bench.report.wording import with_interval


def response(found: KeyComparison, caption: str, *, more: bool = False) -> str:
    """Points with intervals over the values of a key, a small chart for each scenario and each of the other settings.

    Values that are no numbers stand side by side in their order, with no line between them.

    Args:
        found: The comparison.
        caption: What stands below.
        more: Whether paired differences against the reference are shown, and not values.
    """
    numbers = numbers_of(found.values)
    at = numbers or {value: float(number) for number, value in enumerate(found.values)}
    places = list(dict.fromkeys((row.scenario, row.others) for row in found.rows))
    shown = [Panel(title=labelled(*place), aim=at[found.reference], points=[
        _point(found, row, at[row.value], value) for row in found.rows if (row.scenario, row.others) == place
        and (value := _shown(found, row, more=more)) is not None]) for place in places]
    told = f"Value more than at {shown_value(found.reference)}" if more else f"Value over {found.key}"
    axes = Axes(x=found.key, zero=more, joined=numbers is not None, apart=True,
                places=[(at[value], shown_value(value)) for value in found.values])
    return panels(f"{told}: means and 95 % intervals", axes, shown, caption)


def _point(found: KeyComparison, row: ValueRow, at: float, value: Estimate) -> Point:
    usual = row.value == found.reference
    return Point(x=at, y=value.mean, interval=value.ci95, shape="hollow" if usual else "round",
                 said=f"{shown_value(row.value)}: {with_interval(value)}{', the reference' if usual else ''}")


def _shown(found: KeyComparison, row: ValueRow, *, more: bool) -> Estimate | None:
    if not more:
        return row.executed
    if row.value == found.reference:
        return Estimate(mean=0.0, ci95=None)
    return None if row.gain is None else Estimate(mean=row.gain.mean, ci95=row.gain.ci95_adjusted)
