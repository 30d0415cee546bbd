"""How often intervals hold the truth where runs stop by what they see: a table of docs/statistics.md.

Differences of two plans as missions give them: a few values by which robots are there, and losses under rare bad noise
draws, which the trials of a draw share. A run looks after 8 draws of ten trials each, and after each doubling.

    python -m benchmarks.coverage_anytime [--rounds N]
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from sva_bench.analysis.moments import Figure, figure_of
from sva_bench.analysis.precision import Precision
from sva_bench.analysis.statistics import estimate
from sva_bench.arrays import FloatArray

LOOKS = tuple(8 * 2**k for k in range(8))
"""Noise draws at each look."""
TRIALS = 10  # of a draw
ALPHA = 0.05


@dataclass(frozen=True, kw_only=True)
class Case:
    """A kind of difference.

    Attributes:
        values: By the state of the team, with the probability of each.
        bad: Share of noise draws that are bad.
        loss: What a bad draw costs where the uncertain robot is there (the first state).
        precise: Half-width at which a run stops.
    """

    values: Mapping[float, float]
    bad: float
    loss: float
    precise: float

    @property
    def truth(self) -> float:
        """The mean difference."""
        first = next(iter(self.values.values()))
        return sum(value * p for value, p in self.values.items()) - self.bad * first * self.loss


CASES = {
    "two values, no bad draws": Case(values={0.0: 0.75, 60.0: 0.25}, bad=0.0, loss=0.0, precise=3.0),
    "rare gain, no bad draws": Case(values={0.0: 0.97, 300.0: 0.03}, bad=0.0, loss=0.0, precise=5.0),
    "one draw in ten is bad": Case(values={20.0: 0.75, -30.0: 0.25}, bad=0.1, loss=100.0, precise=6.0),
    "one draw in fifty is bad": Case(values={20.0: 0.75, -30.0: 0.25}, bad=0.02, loss=300.0, precise=6.0),
}

Interval = tuple[float, float]
Method = Callable[[Figure, FloatArray, Interval, int], Interval]
"""The interval at a look: from the figure, the means of its draws, what those lie between, and the look's number."""


def fixed(figure: Figure, *_: object) -> Interval:
    """The interval of a fixed sample, as without ``--anytime``."""
    found = estimate(figure).ci95
    assert found is not None
    return found


def doublings(figure: Figure, _means: FloatArray, _bounds: Interval, look: int) -> Interval:
    """That of ``--anytime``."""
    found = estimate(figure, comparisons=Precision(pct=1, max_trials=1, anytime=True, look=look).comparisons).ci95
    assert found is not None
    return found


def asymptotic(_figure: Figure, means: FloatArray, _bounds: Interval, _look: int) -> Interval:
    """Waudby-Smith, Arbour, Sinha, Kennedy & Ramdas (2024), "Time-uniform central limit theory and asymptotic
    confidence sequences", equation (8), tightest at 32 draws."""
    n = len(means)
    rho2 = (-2 * math.log(ALPHA) + math.log(-2 * math.log(ALPHA)) + 1) / 32
    half = float(np.std(means)) * math.sqrt(2 * (n * rho2 + 1) / (n**2 * rho2) * math.log(math.sqrt(n * rho2 + 1)
                                                                                        / ALPHA))
    return float(np.mean(means)) - half, float(np.mean(means)) + half


def bernstein(_figure: Figure, means: FloatArray, bounds: Interval, _look: int) -> Interval:
    """Waudby-Smith & Ramdas (2024), "Estimating means of bounded random variables by betting", Theorem 2: predictable
    plug-in empirical Bernstein, on the means of draws."""
    low, high = bounds
    x = (means - low) / (high - low)
    t = np.arange(1, len(x) + 1)
    mean = (0.5 + np.cumsum(x)) / (t + 1)
    variance = (0.25 + np.cumsum((x - mean) ** 2)) / (t + 1)
    before = np.concatenate([[0.25], variance[:-1]])
    bet = np.minimum(np.sqrt(2 * math.log(2 / ALPHA) / (before * t * np.log(1 + t))), 0.5)
    spent = 4 * (x - np.concatenate([[0.5], mean[:-1]])) ** 2 * (-np.log(1 - bet) - bet) / 4
    centre, half = float(bet @ x / bet.sum()), float((math.log(2 / ALPHA) + spent.sum()) / bet.sum())
    return low + (high - low) * (centre - half), low + (high - low) * (centre + half)


METHODS: dict[str, Method] = {"of a fixed sample": fixed, "--anytime": doublings, "asymptotic": asymptotic,
                              "empirical Bernstein": bernstein}


def _figures(case: Case, rng: np.random.Generator) -> list[tuple[Figure, FloatArray]]:
    """One run: the figure at each look, and the means of its draws."""
    draws = LOOKS[-1]
    values = np.array(list(case.values))
    state = rng.choice(len(values), size=draws * TRIALS, p=list(case.values.values()))
    bad = rng.random(draws) < case.bad
    rollout = np.repeat(np.arange(draws), TRIALS)
    drawn, taken = values[state], np.where(bad[rollout] & (state == 0), case.loss, 0.0)
    means = (drawn - taken).reshape(draws, TRIALS).mean(axis=1)
    bounds = float(values.min()), float(values.max())
    return [(figure_of(drawn[:k * TRIALS], bounds, taken[:k * TRIALS], (0.0, case.loss), rollout[:k * TRIALS],
                       noisy=case.loss > 0), means[:k]) for k in LOOKS]


def main() -> None:
    """Print the table."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--rounds", type=int, default=2000)
    rounds = asked.parse_args().rounds
    print("| differences | interval | holds at all looks | holds where the run stops | draws until then | half-width "
          "after 128 draws |\n| --- | --- | ---: | ---: | ---: | ---: |")
    for number, (name, case) in enumerate(CASES.items()):
        rng = np.random.default_rng([18, number])
        bounds = min(case.values) - case.loss, max(case.values)
        held = {method: [0, 0, 0, 0.0] for method in METHODS}
        for _ in range(rounds):
            looks = _figures(case, rng)
            for method, interval in METHODS.items():
                found = [interval(figure, means, bounds, k) for k, (figure, means) in enumerate(looks)]
                holds = [low <= case.truth <= high for low, high in found]
                stop = next((k for k, (low, high) in enumerate(found) if high - low <= 2 * case.precise),
                            len(LOOKS) - 1)
                tally = held[method]
                tally[0] += all(holds)
                tally[1] += holds[stop]
                tally[2] += LOOKS[stop]
                tally[3] += (found[4][1] - found[4][0]) / 2
        for method, (everywhere, there, draws, width) in held.items():
            print(f"| {name} | {method} | {100 * everywhere / rounds:.1f} | {100 * there / rounds:.1f} | "
                  f"{draws / rounds:.0f} | {width / rounds:.1f} |")
    print(f"\n{rounds} rounds; one figure is sure to {100 * norm.ppf(0.975) * math.sqrt(0.05 * 0.95 / rounds):.1f} "
          "points.")


if __name__ == "__main__":
    main()
