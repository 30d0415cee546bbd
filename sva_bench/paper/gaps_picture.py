"""The paper's Figure 3 again: box plots of gaps, ours beside its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from sva_bench.paper.printed import FIGURE_3, Box, box_of
from sva_bench.paper.solves import METHODS, Row

SIZE_IN = (7.2, 6.8)
DPI = 200
# Okabe and Ito's colours, told apart by the colour-blind; dark and light alternate for print in grey.
COLOURS = {"dep": "#E69F00", "relaxed": "#56B4E9", "lshaped": "#009E73", "expected": "#F0E442", "auto": "#0072B2"}
_PAPER = "0.35"
_TICKS = (0, 0.5, 1, 2, 5, 10, 20, 50, 100, 200)
_LINEAR_PCT = 1.0  # gaps below it are drawn to scale, those above by their logarithm


@dataclass(frozen=True, kw_only=True)
class _Drawn:
    """A box, and where and how it is drawn."""

    box: Box
    at: float
    method: str
    paper: bool


def draw_gaps(rows: Sequence[Row], path: Path) -> None:
    """Draw gaps by number of POIs and by fuel multiple, a box for each method.

    Args:
        rows: Rows, at least one.
        path: A PNG file to write.
    """
    limit = f"{rows[0].time_limit_s:g} s"
    figure = Figure(figsize=SIZE_IN, dpi=DPI, layout="constrained")
    above, below = figure.subplots(2, 1)
    _draw(above, rows, lambda row: row.pois, "Number of POIs", paper=True)
    above.set_title(f"Gap after {limit} by number of POIs; hatched: the paper's, after an hour", loc="left", fontsize=9)
    sizes = {pois for pois, _ in FIGURE_3}
    large = [row for row in rows if row.pois in sizes]
    _draw(below, large or rows, lambda row: row.fuel_multiple, "Fuel capacity in largest distances", paper=False)
    least = min(row.pois for row in large or rows)
    below.set_title(f"Gap after {limit} by fuel capacity, {least} POIs and more", loc="left", fontsize=9)
    methods = [method for method in METHODS if any(row.method == method for row in rows)]
    keys = [Patch(facecolor=COLOURS[method], edgecolor="black", linewidth=0.7, label=method) for method in methods]
    keys.append(Patch(facecolor="white", edgecolor=_PAPER, hatch="/////", linewidth=0.7,
                      label="paper: dep, relaxed, lshaped"))
    figure.legend(handles=keys, loc="outside upper center", ncols=len(keys), fontsize=8, frameon=False,
                  handlelength=1.4, columnspacing=1.2)
    figure.savefig(path, format="png", metadata={"Software": None})  # a library's version is no reason to differ


def _draw(axes: Axes, rows: Sequence[Row], key: Callable[[Row], float], title: str, *, paper: bool) -> None:
    values = sorted({key(row) for row in rows})
    slots = _slots(paper)
    boxes = list(_boxes(rows, values, key, slots, paper))
    width = 0.86 / len(slots)
    for drawn in boxes:
        box = drawn.box
        stats = {"whislo": box.least, "q1": box.lower, "med": box.median, "q3": box.upper, "whishi": box.most}
        line = {"color": _PAPER if drawn.paper else "black", "linewidth": 0.7}
        face = {**line, "edgecolor": line["color"], "hatch": "/////", "facecolor": "white"} if drawn.paper else {
            "edgecolor": "black", "linewidth": 0.7, "facecolor": COLOURS[drawn.method]}
        face.pop("color", None)
        if not drawn.paper and box.lower == box.upper:  # a flat box shows no colour
            axes.plot([drawn.at], [box.median], marker="s", markersize=5, color=COLOURS[drawn.method],
                      markeredgecolor="black", markeredgewidth=0.7, clip_on=False, zorder=4)
        axes.bxp([stats], positions=[drawn.at], widths=0.8 * width, showfliers=False, patch_artist=True,
                 boxprops=face, whiskerprops=line, capprops=line,
                 medianprops={"color": "black", "linewidth": 1.4, "solid_capstyle": "butt"}, manage_ticks=False)
    for k in range(1, len(values)):
        axes.axvline(k - 0.5, color="0.85", linewidth=0.7)
    axes.set_xlim(-0.5, len(values) - 0.5)
    axes.set_xticks(range(len(values)), [f"{value:g}" for value in values])
    axes.tick_params(axis="x", length=0)
    axes.tick_params(labelsize=8)
    axes.set_xlabel(title, fontsize=9)
    axes.set_ylabel("Gap (%), logarithmic above 1", fontsize=9)
    axes.set_yscale("symlog", linthresh=_LINEAR_PCT, linscale=0.5)
    most = max((drawn.box.most for drawn in boxes), default=1.0)
    axes.set_ylim(-0.08, max(1.25 * most, 2.0))
    axes.yaxis.set_major_locator(FixedLocator(_TICKS))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda gap, _: f"{gap:g}"))
    axes.grid(axis="y", color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def _slots(paper: bool) -> list[tuple[str, bool]]:
    """What stands in a group from left to right: method, and whether it is the paper's box."""
    printed = {method for _, method in FIGURE_3} if paper else set()
    return [(method, own) for method in METHODS for own in ((True, False) if method in printed else (False,))]


def _boxes(
    rows: Sequence[Row], values: Sequence[float], key: Callable[[Row], float], slots: Sequence[tuple[str, bool]],
    paper: bool,
) -> Iterator[_Drawn]:
    for group, value in enumerate(values):
        present = [slot for slot in slots if not slot[1] or (int(value), slot[0]) in FIGURE_3]
        for k, (method, own) in enumerate(present):
            at = group + 0.86 * ((k + 0.5) - len(present) / 2) / len(slots)
            gaps = [row.gap_pct for row in rows if row.method == method and key(row) == value]
            if own and paper:
                yield _Drawn(box=FIGURE_3[int(value), method], at=at, method=method, paper=True)
            elif gaps:
                yield _Drawn(box=box_of(gaps), at=at, method=method, paper=False)
