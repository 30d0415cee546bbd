"""What the paper prints of its solves: facts to stand beside ours.

Source:
    Venkatachalam & Smereka, *UV mission planning under uncertainty in vehicles' availability*, section 5.1: CPLEX 12.9
    on an Intel Xeon E5630 at 2.53 GHz, an hour for each instance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

LIMIT_S = 3600.0
"""Time limit of the paper's solves [s]."""


@dataclass(frozen=True, kw_only=True)
class PrintedCuts:
    """A row of Table 2, averages over the solves of the decomposition.

    Attributes:
        optimality: Optimality cuts ("BD").
        subtour: Subtour elimination cuts ("SEC").
        gap_pct: Gap [%].
    """

    optimality: int
    subtour: int
    gap_pct: float


@dataclass(frozen=True, kw_only=True)
class PrintedRuntime:
    """A row of Table 3, over the solves of the decomposition, as printed [s]; "<1" is all that is said of some."""

    least: str
    most: str
    mean: str
    median: str
    deviation: str


@dataclass(frozen=True, kw_only=True)
class Box:
    """Five figures of a box plot, here of gaps [%].

    Attributes:
        least: Lower whisker.
        lower: Lower quartile.
        median: Median.
        upper: Upper quartile.
        most: Upper whisker.
    """

    least: float
    lower: float
    median: float
    upper: float
    most: float


TABLE_2: dict[int, PrintedCuts] = {
    10: PrintedCuts(optimality=4, subtour=84, gap_pct=0.0),
    20: PrintedCuts(optimality=11, subtour=740, gap_pct=0.0),
    30: PrintedCuts(optimality=30, subtour=5536, gap_pct=0.0),
    40: PrintedCuts(optimality=35, subtour=15935, gap_pct=2.35),
    50: PrintedCuts(optimality=42, subtour=18560, gap_pct=7.80),
    60: PrintedCuts(optimality=47, subtour=23000, gap_pct=11.15),
}
"""Table 2, "Number of optimality and sub-tour elimination cuts, and average MIP gap", by number of POIs."""

TABLE_3: dict[int, PrintedRuntime] = {
    10: PrintedRuntime(least="<1", most="7", mean="<1", median="<1", deviation="<1"),
    20: PrintedRuntime(least="<1", most="240", mean="27", median="3", deviation="54"),
    30: PrintedRuntime(least="<1", most="3600", mean="1136", median="175", deviation="1494"),
    40: PrintedRuntime(least="30", most="3600", mean="2640", median="3600", deviation="1518"),
    50: PrintedRuntime(least="380", most="3600", mean="3439", median="3600", deviation="720"),
    60: PrintedRuntime(least="3600", most="3600", mean="3600", median="3600", deviation="0"),
}
"""Table 3, "Runtime (seconds) for decomposition algorithm", by number of POIs."""

FIGURE_3_LETTERS = {"dep": "a", "relaxed": "b", "lshaped": "c"}
"""What Figure 3 calls the methods: formulation (a), reformulation (b), decomposition (c)."""

FIGURE_3: dict[tuple[int, str], Box] = {
    (40, "dep"): Box(least=0, lower=0, median=0, upper=1.8, most=22),
    (40, "relaxed"): Box(least=0, lower=0, median=0, upper=1.82, most=11.95),
    (40, "lshaped"): Box(least=0, lower=0, median=1.9, upper=3.7, most=7.9),
    (50, "dep"): Box(least=0, lower=0, median=2.8, upper=6.6, most=59),
    (50, "relaxed"): Box(least=0, lower=0, median=1.62, upper=6.5, most=27.4),
    (50, "lshaped"): Box(least=0, lower=2, median=4.75, upper=11.2, most=27.4),
    (60, "dep"): Box(least=0, lower=1.2, median=8.2, upper=27, most=159),
    (60, "relaxed"): Box(least=0, lower=2, median=9.3, upper=15, most=66),
    (60, "lshaped"): Box(least=0, lower=3.2, median=12.7, upper=16.5, most=23.73),
}
"""Figure 3, box plots of gaps by number of POIs and method; the boxes are given as figures in the paper's source."""



def box_of(gaps: Sequence[float]) -> Box:
    """The five figures of some gaps: quartiles by linear interpolation, whiskers to the least and greatest."""
    least, lower, middle, upper, most = (float(q) for q in np.percentile(gaps, (0, 25, 50, 75, 100)))
    return Box(least=least, lower=lower, median=middle, upper=upper, most=most)
