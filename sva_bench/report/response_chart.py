"""The response figures of a batch: what is worth how much over the values of a varied key, a small chart a scenario."""

from __future__ import annotations

from sva_bench.analysis.compared_values import KeyComparison, ValueRow, numbers_of, shown_value
from sva_bench.analysis.over_maps import BatchSummary, OverMaps, labelled
from sva_bench.analysis.results import Estimate
from sva_bench.report.panels import Axes, Panel, Point, panels
from sva_bench.report.variant_names import VariantNames
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


def vss_responses(summary: BatchSummary, names: VariantNames) -> list[str]:
    """The VSS over the values of each key that varies in numbers; none where none does."""
    return [picture for key in names.keys if (picture := _vss_over(key, summary, names))]


def _vss_over(key: str, summary: BatchSummary, names: VariantNames) -> str:
    at = numbers_of(tuple(dict.fromkeys(settings[key] for settings in summary.settings.values() if key in settings)))
    if at is None or len(at) < 2:
        return ""
    places: dict[tuple[str, str], list[Point]] = {}
    for row in summary.aggregate:
        settings = dict(summary.settings.get(row.variant, {}))
        if (value := settings.pop(key, None)) is not None:
            places.setdefault((row.scenario, names.told(settings)), []).append(_vss_point(row, at[value], value))
    axes = Axes(x=key, zero=True, joined=True, apart=True, places=[(at[value], shown_value(value)) for value in at])
    shown = [Panel(title=labelled(*place), points=points) for place, points in places.items()
             if any(point.y or point.interval not in (None, (0.0, 0.0)) for point in points)]
    left_out = " Scenarios without any difference are left out." if len(shown) < len(places) else ""
    return panels(f"VSS over {key}: means over maps and 95 % intervals", axes, shown,
                  f"VSS over {key}: mean over maps, each with its own 95 % interval. Above zero, planning for failures "
                  f"pays.{left_out}")


def _vss_point(row: OverMaps, at: float, value: str) -> Point:
    return Point(x=at, y=row.vss.mean, interval=row.vss.ci95, said=f"{shown_value(value)}: {with_interval(row.vss)}")


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
