"""Sequential stopping: a run that continues until its interval has a required relative half-width."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from sva_bench.analysis.results import Estimate
from sva_bench.analysis.scenarios import ScenarioSummary
from sva_bench.analysis.summaries import ReachedPrecision, Summary
from sva_bench.errors import BadInput
from sva_bench.files.complaints import hint_of_per_cent


@dataclass(frozen=True, kw_only=True)
class Precision:
    """A stopping rule.

    Attributes:
        pct: Required relative half-width of the executed VSS in every scenario [% of the stochastic plan's mean].
        max_trials: Trials at which the run stops in any case.
        anytime: Whether the intervals that it stops by hold at all looks together.
        look: Number of the look at the data that comes next, from 0.
    """

    pct: float
    max_trials: int
    anytime: bool = False
    look: int = 0

    @property
    def comparisons(self) -> int:
        """Number of intervals that hold simultaneously, as one at this look counts among those of all looks.

        Look k gets 1 / ((k + 1) (k + 2)) of what may go wrong, which adds up to all of it over any number of looks: so
        the intervals at all looks hold together, and the one at which a run stops does, whatever it stops by. It is
        the interval of a fixed sample otherwise, with all that it allows for noise draws that were not met.

        Source:
            Darling & Robbins (1967), "Confidence sequences for mean, variance, and median"; Mnih, Szepesvari & Audibert
            (2008), "Empirical Bernstein stopping", for looks at each doubling; Howard, Ramdas, McAuliffe & Sekhon
            (2021), "Time-uniform, nonparametric, nonasymptotic confidence sequences".
        """
        return (self.look + 1) * (self.look + 2) if self.anytime else 1

    def next_size(self, summary: Summary) -> tuple[int, int] | None:
        """Trials and rollouts of the next step, twice as many of both; ``None`` = stop.

        More trials under the same noise draws would not reduce the variance due to noise, so both grow. Few interim
        analyses, each of twice the data, keep the probability of stopping too early small.

        Source:
            Chow & Robbins (1965), "On the asymptotic theory of fixed-width sequential confidence intervals"; Glynn &
            Whitt (1992), "The asymptotic validity of sequential stopping rules for stochastic simulations".
        """
        reached = summary.precision or self.reached(summary.scenarios)
        if reached.met or summary.trials >= self.max_trials:
            return None
        trials = min(2 * summary.trials, self.max_trials)
        return trials, math.ceil(summary.rollouts * trials / summary.trials)

    def after_look(self) -> Precision:
        """The rule at the next look."""
        return replace(self, look=self.look + 1)

    def reached(
        self, scenarios: Sequence[ScenarioSummary], anytime: Mapping[str, Estimate] | None = None,
    ) -> ReachedPrecision:
        """The precision reached, and whether every scenario has the required one.

        Args:
            scenarios: Results so far.
            anytime: The executed VSS of each with the interval that holds at all looks together; ``None`` = its own.
        """
        reached = half_width_pct(scenarios, anytime)
        return ReachedPrecision(
            asked_pct=self.pct, reached_pct=reached, max_trials=self.max_trials,
            met=reached is not None and reached <= self.pct,
            anytime=None if anytime is None else {name: found.ci95 for name, found in anytime.items()})


def half_width_pct(scenarios: Sequence[ScenarioSummary], vss: Mapping[str, Estimate] | None = None) -> float | None:
    """The greatest relative half-width of an executed VSS over scenarios [% of the stochastic plan's mean].

    0 where nothing varies; ``None`` where there is no interval, or the mean is not positive.

    Args:
        scenarios: The scenarios.
        vss: The executed VSS of each, where it is not that of its summary.
    """
    widths = []
    for scenario in scenarios:
        found = scenario.vss.executed if vss is None else vss[scenario.name]
        half, mean = found.half_width, scenario.stochastic.executed.mean
        if half is None or (half > 0 and mean <= 0):
            return None
        widths.append(100 * half / mean if half > 0 else 0.0)
    return max(widths, default=0.0)


def precision_of(text: str, max_trials: int, trials: int, rollouts: int, *, anytime: bool = False) -> Precision:
    """The precision given on the command line, such as ``1%``.

    Raises:
        BadInput: If it is no percentage, or can't be reached with these trials and rollouts.
    """
    figure = text.strip()
    try:
        pct = float(figure.removesuffix("%")) if figure.endswith("%") else math.nan
    except ValueError:
        pct = math.nan
    if not (math.isfinite(pct) and pct > 0):
        raise BadInput(f"--precision {text}: expected per cent of the stochastic plan's mean, such as 1%"
                       f"{hint_of_per_cent(figure)}")
    if max_trials < trials:
        raise BadInput(f"--max-trials {max_trials} is less than --trials {trials}, with which a run begins")
    if min(trials, rollouts) < 2:
        raise BadInput("--precision needs an interval from the start: at least 2 --trials and 2 --rollouts")
    return Precision(pct=pct, max_trials=max_trials, anytime=anytime)
