"""Metric repair: fuel costs that obey the triangle inequality, and the chain of legs behind each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import floyd_warshall

from sva_bench.arrays import FloatArray, IntArray, frozen_int
from sva_bench.files.printable import counted
from sva_bench.travel.times import TravelTimes


@dataclass(frozen=True, eq=False, kw_only=True)
class FuelCosts:
    """Metric fuel costs between sites, and the chain of legs behind each.

    Attributes:
        times: The travel times that were repaired.
        repaired_ms: Cheapest chain from site i to site j [ms], shape (n, n), zero diagonal.
        via: Next site on that chain, shape (n, n); j itself where the direct leg is as cheap.
        margin: Planning costs are the repaired times x (1 + margin).
    """

    times: TravelTimes
    repaired_ms: IntArray
    via: IntArray
    margin: float

    def __post_init__(self) -> None:
        n = len(self.times.sites)
        object.__setattr__(self, "repaired_ms", frozen_int(self.repaired_ms, (n, n)))
        object.__setattr__(self, "via", frozen_int(self.via, (n, n)))

    def __repr__(self) -> str:
        return (f"FuelCosts({self.times.model.name}: {counted(len(self.times.sites), 'site')}, "
                f"{self.changed_pct:.1f} % repaired, margin {self.margin:g})")

    @property
    def cost_s(self) -> FloatArray:
        """Planning cost from site i to site j [s], to the nanosecond, shape (n, n)."""
        # Scaling keeps the triangle inequality; rounding breaks it by 2e-9 s at most, far below the tolerance.
        return np.round(self.repaired_ms * (1.0 + self.margin) / 1000.0, 9)

    def chain(self, origin: str, destination: str) -> tuple[str, ...]:
        """Sites of the cheapest chain from one site to another, both included.

        Raises:
            UnknownName: If there is no such site.
        """
        sites = self.times.sites
        here, end = self.times.number_of(origin), self.times.number_of(destination)
        chain = [here]
        while here != end:
            here = int(self.via[here, end])
            chain.append(here)
        return tuple(sites[k] for k in chain)

    @property
    def pairs(self) -> int:
        """Number of directed pairs of sites."""
        n = len(self.times.sites)
        return n * (n - 1)

    @property
    def changed_pct(self) -> float:
        """Share of pairs whose direct leg cost more than a chain [%]."""
        changed = int((self.repaired_ms < self.times.time_ms).sum())
        return 100.0 * changed / self.pairs if self.pairs else 0.0

    @property
    def max_excess_pct(self) -> float:
        """Greatest excess of a direct leg over the cheapest chain [% of the chain]."""
        excess = (self.times.time_ms - self.repaired_ms) / np.maximum(self.repaired_ms, 1)
        return 100.0 * float(excess.max(initial=0.0))


def repair_metric(time_ms: IntArray) -> tuple[IntArray, IntArray]:
    """Lower each time to that of the cheapest chain of legs between its ends.

    A sampling planner's paths are good, not optimal, so a detour by way of k can beat the direct leg. This is the
    shortest-path closure: the largest matrix nowhere above ``time_ms`` that obeys the triangle inequality.
    In integer milliseconds it holds exactly; rounded floats would still violate it by an ulp.

    Args:
        time_ms: Time from site i to site j [ms], positive off the diagonal, shape (n, n). Need not be symmetric.

    Returns:
        Repaired times, shape (n, n); next site on each cheapest chain, shape (n, n).

    Raises:
        ValueError: If ``time_ms`` is not square, or not positive off the diagonal.

    Source:
        Floyd (1962), "Algorithm 97: Shortest path"; section 5.2 of the paper, which leaves out the chains.
    """
    n = len(time_ms)
    if time_ms.shape != (n, n) or (time_ms[~np.eye(n, dtype=bool)] <= 0).any():
        raise ValueError("expected a square matrix of positive times")
    if n == 1:
        return np.zeros((1, 1), dtype=np.int64), np.zeros((1, 1), dtype=np.int64)
    # Doubles hold integer milliseconds exactly up to 285 000 years.
    repaired = np.rint(floyd_warshall(time_ms.astype(np.float64))).astype(np.int64)
    via = np.tile(np.arange(n), (n, 1))
    for i, j in np.argwhere(repaired < time_ms):
        # A next site k: the leg there is direct, and the rest of the chain is a cheapest one; the first in order.
        on_chain = (time_ms[i] == repaired[i]) & (repaired[i] + repaired[:, j] == repaired[i, j])
        on_chain[[i, j]] = False
        via[i, j] = int(np.flatnonzero(on_chain)[0])
    return repaired, via


def fuel_costs(times: TravelTimes, margin: float) -> FuelCosts:
    """Metric fuel costs from travel times.

    Args:
        times: The travel times.
        margin: Relative safety margin on them.
    """
    repaired, via = repair_metric(times.time_ms)
    return FuelCosts(times=times, repaired_ms=repaired, via=via, margin=margin)
