"""The catalogue of a plan's statistics: an entry for each, with its meaning, source and where it is shown.

The terminal's table, the page, ``statistics.csv`` and the table in ``docs/statistics.md`` are made of these entries;
``summary.json`` holds the figures of all. A new statistic is one entry with ``measure``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol

from sva_bench.analysis.moments import Figure
from sva_bench.analysis.results import Distribution, Estimate, Ledger, PlanFigures, PlanResult
from sva_bench.execution.executed import Executed

Place = Literal["terminal", "page", "csv"]
Section = Literal["over trials", "promise", "measured"]
"""Table of the page that a statistic is a column of."""
Value = float | Estimate | None


class Measure(Protocol):
    """A statistic as a function of a plan's trials."""

    def __call__(self, run: Executed, *, noisy: bool) -> Figure:
        """The statistic of a plan's trials, as a figure that adds up over ranges of trials."""


@dataclass(frozen=True, kw_only=True)
class Statistic:
    """One statistic of a plan.

    Attributes:
        key: Its key in a plan of ``summary.json``; of a measured one, below ``statistics``.
        label: Heading of its column.
        unit: Its unit; empty = that of value: of incentives in the world file.
        meaning: What it is, for the docs.
        read: Reads it from the result of a plan; ``None`` for one with ``measure``.
        measure: Measures it from a plan's trials.
        shown: Where it is a column; ``summary.json`` has all.
        section: The table of the page that it is a column of.
        interval: Whether its value is a mean with an interval, as measured ones always are.
        factor: Factor from the value to the one shown, such as 100 for per cent.
        signed: Whether it is shown with a plus sign when positive.
    """

    key: str
    label: str
    unit: str = ""
    meaning: str
    read: Callable[[PlanFigures], Value] | None = None
    measure: Measure | None = None
    shown: frozenset[Place] = frozenset({"terminal", "page", "csv"})
    section: Section = "measured"
    interval: bool = False
    factor: float = 1.0
    signed: bool = False

    def __post_init__(self) -> None:
        if (self.read is None) == (self.measure is None):
            raise ValueError(f"{self.key}: a statistic is read from a result or measured of trials, one of the two")
        object.__setattr__(self, "interval", self.interval or self.measure is not None)

    @property
    def heading(self) -> str:
        """Label and unit, as a column's heading."""
        return f"{self.label} [{self.unit}]" if self.unit else self.label

    @property
    def place(self) -> str:
        """Its dotted key in a plan of ``summary.json``."""
        return self.key if self.measure is None else f"statistics.{self.key}"

    def of(self, plan: PlanFigures) -> Value:
        """Its value for a plan, in the unit shown; ``None`` where the plan has none."""
        value = plan.statistics.get(self.key) if self.read is None else self.read(plan)
        if value is None or self.factor == 1.0:
            return value
        if isinstance(value, Estimate):
            return Estimate(mean=self.factor * value.mean, ci95=value.ci95 and (
                self.factor * value.ci95[0], self.factor * value.ci95[1]))
        return self.factor * value


def _over_trials(key: str, label: str, meaning: str, read: Callable[[Distribution], float]) -> Statistic:
    return Statistic(key=f"distribution.{key}", label=label, meaning=meaning, section="over trials",
                     shown=frozenset({"page", "csv"}),
                     read=lambda plan: read(plan.distribution) if isinstance(plan, PlanResult) else None)


def _charged(key: str, meaning: str, read: Callable[[Ledger], float]) -> Statistic:
    return Statistic(key=f"ledger.{key}", label=key.replace("_", " "), meaning=meaning, section="promise", signed=True,
                     shown=frozenset({"page", "csv"}), read=lambda plan: read(plan.ledger))


STATISTICS: tuple[Statistic, ...] = (
    Statistic(key="promised", label="promised", section="promise", read=lambda plan: plan.promised,
              meaning="value in the plan's own objective, as its planner claims it"),
    Statistic(key="expected", label="expected", shown=frozenset({"terminal", "csv"}), read=lambda plan: plan.expected,
              meaning="closed-form value under the failure process executed"),
    _charged("assumption", "expected less promised", lambda ledger: ledger.assumption),
    _charged("draws", "failures as drawn, against their expectation", lambda ledger: ledger.draws),
    _charged("out_of_fuel", "what robots out of fuel did not collect, and the cost of their loss",
             lambda ledger: ledger.out_of_fuel),
    _charged("late", "incentive that robots past their mission limit did not collect", lambda ledger: ledger.late),
    _charged("stuck", "what stuck robots did not collect, and the cost of their loss", lambda ledger: ledger.stuck),
    Statistic(key="executed", label="executed", section="promise", interval=True, read=lambda plan: plan.executed,
              meaning="mean over trials of the team's value (incentive less the cost of lost robots), with its 95 % "
                      "interval"),
    Statistic(key="executed_controlled", label="executed, variance-reduced", section="promise",
              interval=True, shown=frozenset({"page", "csv"}),
              read=lambda plan: plan.executed_controlled if isinstance(plan, PlanResult) else None,
              meaning="the same, with the closed form in place of the failures drawn"),
    _over_trials("least", "least", "least of all trials", lambda found: found.least),
    _over_trials("cvar10", "worst tenth", "mean of the worst tenth of the trials (CVaR)", lambda found: found.cvar10),
    _over_trials("q05", "5 %", "5 % quantile of the trials", lambda found: found.q05),
    _over_trials("q25", "25 %", "25 % quantile", lambda found: found.q25),
    _over_trials("q50", "50 %", "median", lambda found: found.q50),
    _over_trials("q75", "75 %", "75 % quantile", lambda found: found.q75),
    _over_trials("q95", "95 %", "95 % quantile", lambda found: found.q95),
    _over_trials("greatest", "greatest", "greatest of all trials", lambda found: found.greatest),
)


def statistics(place: Place | None = None, section: Section | None = None) -> tuple[Statistic, ...]:
    """The entries of the catalogue, or those shown in a place, or in one table of the page."""
    return tuple(entry for entry in STATISTICS if (place is None or place in entry.shown)
                 and (section is None or entry.section == section))


def measured(run: Executed, *, noisy: bool) -> dict[str, Figure]:
    """The figures of the statistics with ``measure``, by key."""
    return {entry.key: entry.measure(run, noisy=noisy) for entry in STATISTICS if entry.measure is not None}


def csv_columns() -> list[str]:
    """Columns of ``statistics.csv``; each mean is followed by the ends of its interval."""
    return [name for entry in statistics("csv") for name in (
        (entry.key, f"{entry.key}_low", f"{entry.key}_high") if entry.interval else (entry.key,))]


def csv_cells(plan: PlanFigures) -> list[float | None]:
    """The row of a plan in ``statistics.csv``."""
    cells: list[float | None] = []
    for entry in statistics("csv"):
        value = entry.of(plan)
        if entry.interval:
            assert value is None or isinstance(value, Estimate)
            cells += [None, None, None] if value is None else [value.mean, *(value.ci95 or (None, None))]
        else:
            assert not isinstance(value, Estimate)
            cells.append(value)
    return cells


def as_markdown() -> str:
    """The table of all statistics, as ``docs/statistics.md`` holds it."""
    rows = ["| in `summary.json` | column | unit | what it is | shown on |", "| --- | --- | --- | --- | --- |"]
    rows += [f"| `{entry.place}` | {entry.label} | {entry.unit or 'value'} | {entry.meaning} | "
             f"{', '.join(place for place in ('terminal', 'page', 'csv') if place in entry.shown)} |"
             for entry in STATISTICS]
    return "\n".join(rows) + "\n"
