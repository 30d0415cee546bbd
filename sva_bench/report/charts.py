"""Charts of a summary, in a colour-blind safe palette, with hatching or shape as a second cue."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from sva_bench.analysis.scenarios import ComparedScenario, ScenarioSummary
from sva_bench.arrays import FloatArray
from sva_bench.report.canvas import Axes, chart
from sva_bench.report.styles import robot_colour

AnyScenario = ScenarioSummary | ComparedScenario

_HATCHES = ("", "///", "...", "xxx", "\\\\\\", "ooo", "+++", "---")
_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")


def value_by_robot(scenarios: Sequence[AnyScenario], plan: str, beside: Sequence[str] = ()) -> str:
    """Bars: the value of each robot, scenario by scenario (Figures 4 and 7 of the paper).

    Args:
        scenarios: Of a summary.
        plan: Whose bars they are.
        beside: Plans whose charts stand beside this one: all have the axis of the greatest.
    """
    robots = list(scenarios[0].availability)
    heights = {robot: [s.plans[plan].by_robot[robot] for s in scenarios] for robot in robots}
    shown = [s.plans[name].by_robot[robot] for s in scenarios for name in {plan, *beside} for robot in robots]
    least, most = min(0.0, *shown), max(0.0, *shown)  # below 0: a robot's loss cost more than it collected

    def draw(axes: Axes) -> None:
        _bars(axes, [s.name for s in scenarios], heights, robot_colour)
        axes.set_ylabel("mean value [world file's units]")
        axes.set_title(f"Value by robot, {plan} plan")
        if most > least:
            axes.set_ylim(1.05 * least, 1.05 * most)

    return chart(_name("robots", plan), f"Mean value of each robot in each scenario, {plan} plan",
                 (_width(len(scenarios), len(robots)), 3.6), draw)


def legs_driven(planned_s: FloatArray, driven_s: FloatArray, robots: Sequence[str], order: Sequence[str]) -> str:
    """Points: how far each leg's driven time is off the planned one.

    Args:
        planned_s, driven_s: Of each leg [s].
        robots: Whose it is.
        order: The robots of the world.
    """
    def draw(axes: Axes) -> None:
        names = np.asarray(robots)
        for number, robot in enumerate(order):
            mine = names == robot
            if not mine.any():
                continue
            axes.plot(planned_s[mine], 100 * (driven_s[mine] / planned_s[mine] - 1), linestyle="none",
                      marker=_MARKERS[number % len(_MARKERS)], color=robot_colour(number), markersize=4,
                      markeredgecolor="black", markeredgewidth=0.3, alpha=0.75, label=robot,
                      rasterized=len(names) > _MANY)
        axes.axhline(0, color="#444", linewidth=1)
        axes.set_xlabel("planned time of the leg [s]")
        axes.set_ylabel("driven against planned [%]")
        axes.set_title("Legs as driven")
        axes.grid(color="#ddd")
        _legend(axes)

    return chart("legs", "Driven against planned time of each leg in per cent, by planned time", (6.0, 3.6), draw)


_MANY = 2000  # points from which on an SVG holds them as an image


def _bars(axes: Axes, groups: Sequence[str], heights: Mapping[str, Sequence[float]],
          colour: Callable[[int], str]) -> None:
    for number, (name, tall) in enumerate(heights.items()):
        at = [k + _offset(number, len(heights)) for k in range(len(groups))]
        axes.bar(at, tall, width=0.8 / len(heights), facecolor=colour(number), hatch=_hatch(number),
                 edgecolor="black", linewidth=0.6, label=name)
    _names(axes, groups)
    _legend(axes)


def _names(axes: Axes, groups: Sequence[str]) -> None:
    crowded = sum(map(len, groups)) > 40
    axes.set_xticks(range(len(groups)), groups, rotation=30 if crowded else 0, ha="right" if crowded else "center")
    axes.set_xlim(-0.6, len(groups) - 0.4)
    axes.grid(axis="y", color="#ddd")


def _legend(axes: Axes) -> None:
    handles, labels = legend_of(axes)
    axes.legend(handles, labels, loc="upper left", bbox_to_anchor=(0, -0.16), frameon=False, handlelength=1.8,
                fontsize=9, ncols=columns_of(labels, axes, 3))


def legend_of(axes: Axes) -> tuple[list[Any], list[str]]:
    """What a legend shows, with names in lines that fit the chart: plans from anywhere may have long ones."""
    handles, labels = axes.get_legend_handles_labels()
    most = max(8, int((_width_of(axes) - _LEGEND_MARGIN_IN) / _LETTER_IN))
    return handles, [textwrap.fill(label, most) for label in labels]


def _width_of(axes: Axes) -> float:
    figure = axes.get_figure(root=True)
    assert figure is not None
    return float(figure.get_size_inches()[0])


def columns_of(labels: Sequence[str], axes: Axes, most: int) -> int:
    """Columns of a legend that fit the width of a chart, ``most`` at most."""
    longest = max((len(line) for label in labels for line in label.splitlines()), default=0)
    return max(1, min(most, int((_width_of(axes) - 0.9) / (0.6 + _LETTER_IN * longest))))


_LETTER_IN = 0.08  # of the size of a legend, on average and a little more
_LEGEND_MARGIN_IN = 1.5  # the axis beside it, and its mark


def _offset(number: int, of: int) -> float:
    return 0.8 * ((number + 0.5) / of - 0.5)


def _hatch(number: int) -> str:
    return _HATCHES[number % len(_HATCHES)]


def _width(groups: int, series: int) -> float:
    return min(max(4.8, 1.2 + 0.34 * groups * max(series, 2)), 12.0)


def _name(kind: str, of: str) -> str:
    return kind + "-" + "".join(c if c.isascii() and c.isalnum() else f"_{ord(c):x}_" for c in of)


