"""The response figure of a batch: what plans are worth over the values of a varied key."""

from __future__ import annotations

from sva_bench.analysis.compared_values import KeyComparison, ValueRow, numbers_of, shown_value
from sva_bench.analysis.over_maps import labelled
from sva_bench.analysis.results import Estimate
from sva_bench.report.canvas import Axes, chart
from sva_bench.report.charts import columns_of, legend_of, marker

_INK, _STROKES = "#000000", ("-", "--", ":", "-.")  # colours are those of robots and plans
_APART = 0.012  # of the axis: lines of several scenarios would hide each other's intervals


def response(found: KeyComparison, *, more: bool = False) -> str:
    """Points with intervals over the values of a key, a line for each scenario and combination of other settings.

    Values that are no numbers stand side by side in their order, with no line between them.

    Args:
        found: The comparison.
        more: Whether paired differences against the reference are shown, and not values.
    """
    numbers = numbers_of(found.values)
    at = numbers or {value: float(number) for number, value in enumerate(found.values)}
    places = list(dict.fromkeys((row.scenario, row.others) for row in found.rows))
    reach = max(at.values()) - min(at.values()) or 1.0
    title = f"Value more than at {shown_value(found.reference)}" if more else f"Value over {found.key}"

    def draw(axes: Axes) -> None:
        for number, place in enumerate(places):
            rows = sorted((row for row in found.rows if (row.scenario, row.others) == place),
                          key=lambda row: at[row.value])
            aside = _APART * reach * (number - (len(places) - 1) / 2)
            points = [(at[row.value] + aside, shown) for row in rows if (shown := _shown(found, row, more=more))]
            axes.plot([x for x, _ in points], [shown.mean for _, shown in points], color=_INK, marker=marker(number),
                      linestyle=_STROKES[number % len(_STROKES)] if numbers else "none", label=labelled(*place))
            for x, shown in points:
                if shown.ci95 is not None:
                    axes.plot([x, x], shown.ci95, color=_INK, linewidth=1.4, marker="_", markersize=7)
        axes.axvline(at[found.reference], color="#444", linewidth=1, linestyle="--",
                     label=f"the reference, {shown_value(found.reference)}")
        if more:
            axes.axhline(0, color="#444", linewidth=1)
        if len(found.values) <= _MOST_TICKS:
            crowded = sum(len(shown_value(value)) for value in found.values) > 40
            axes.set_xticks([at[value] for value in found.values], [_short(shown_value(value))
                                                                    for value in found.values],
                            rotation=30 if crowded else 0, ha="right" if crowded else "center")
        axes.set_xlabel(found.key)
        axes.set_ylabel("difference [world file's units]" if more else "mean value [world file's units]")
        axes.set_title(title if len(title) <= _LONG else "Value over the varied key")
        axes.grid(color="#ddd")
        handles, labels = legend_of(axes)
        axes.legend(handles, labels, loc="upper left", bbox_to_anchor=(0, -0.22), frameon=False, fontsize=9,
                    ncols=columns_of(labels, axes, 3))

    name = "".join(c if c.isascii() and c.isalnum() else f"_{ord(c):x}_" for c in found.key)
    return chart(f"{'gain' if more else 'response'}-{name}", f"{title}: means and 95 % intervals", (6.0, 3.8), draw)


def _shown(found: KeyComparison, row: ValueRow, *, more: bool) -> Estimate | None:
    if not more:
        return row.executed
    if row.value == found.reference:
        return Estimate(mean=0.0, ci95=None)
    return None if row.gain is None else Estimate(mean=row.gain.mean, ci95=row.gain.ci95_adjusted)


_MOST_TICKS, _LONG, _LONGEST = 12, 60, 24


def _short(value: str) -> str:
    return value if len(value) <= _LONGEST else f"{value[:_LONGEST - 3]}..."
