"""Subset-row cuts: of three rows that admit one route each, no more than one route can take two.

Three POIs make such a cut, or two POIs and a vehicle. A route that passes a site outside a cut's memory forgets the
first of its visits there and isn't counted for it, so that most labels of pricing needn't know of the cut.

Source:
    Jepsen, Petersen, Spoorendonk, Pisinger (2008), "Subset-row inequalities applied to the vehicle-routing problem with
    time windows"; Pecin, Pessoa, Poggi, Uchoa (2017), "Improved branch-cut-and-price for capacitated vehicle routing"
    on limited memory.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sva_bench.arrays import FloatArray
from sva_bench.solver.columns.listing import counts
from sva_bench.solver.columns.master import Column, Stops

MOST_CUTS = 150
_BITS = 64  # of a label, one a cut
A_ROUND = 20
_VIOLATED = 0.03


@dataclass(frozen=True, kw_only=True)
class SubsetRow:
    """A cut.

    Attributes:
        pois: Three POIs, or two.
        kind: With two POIs the class of one vehicle whose row is the third.
        memory: Sites that remember a first visit.
    """

    pois: tuple[int, ...]
    kind: int | None
    memory: frozenset[int]


class Counter:
    """Counts how often each of some cuts counts a route."""

    def __init__(self, cuts: Sequence[SubsetRow], n: int) -> None:
        self._member, self._memory = np.zeros((len(cuts), n), dtype=np.bool_), np.zeros((len(cuts), n), dtype=np.bool_)
        for k, cut in enumerate(cuts):
            self._member[k, list(cut.pois)], self._memory[k, list(cut.memory)] = True, True
        self._kind = np.array([-1 if cut.kind is None else cut.kind for cut in cuts], dtype=np.int64)

    def of(self, kind: int, route: Stops) -> FloatArray:
        """How often each cut counts a route of a class, shape (cuts,)."""
        counted: FloatArray = counts(self._member, self._memory, self._kind == kind, np.array(route))
        return counted


@dataclass(frozen=True, eq=False, kw_only=True)
class CutDuals:
    """Duals of the cuts for the routes of a vehicle class, bit by bit for compiled labels.

    Attributes:
        touch: Cuts of which a site is a POI, shape (n,), uint64.
        recall: Cuts in whose memory a site is, shape (n,), uint64.
        once: Cuts whose dual is due at the first visit alone; that of the others at each second one.
        dual: Dual of each, positive, shape (cuts,).
    """

    touch: NDArray[np.uint64]
    recall: NDArray[np.uint64]
    once: np.uint64
    dual: FloatArray


def cut_duals_of(cuts: Sequence[SubsetRow], duals: FloatArray, kind: int, n: int) -> CutDuals:
    """The duals of the cuts, shape (cuts,), for the routes of a vehicle class."""
    touch, recall, once = np.zeros(n, dtype=np.uint64), np.zeros(n, dtype=np.uint64), 0
    # A cut without a bit counts as if its dual were 0: reduced values are then no lower, and bounds stay valid.
    priced = [int(k) for k in np.argsort(-duals, kind="stable")[:_BITS] if duals[k] > 0.0]
    for number, k in enumerate(priced):
        bit = np.uint64(1) << np.uint64(number)
        touch[list(cuts[k].pois)] |= bit
        if cuts[k].kind == kind:
            once |= 1 << number
            recall |= bit
        else:
            recall[list(cuts[k].memory)] |= bit
    return CutDuals(touch=touch, recall=recall, once=np.uint64(once), dual=np.array([duals[k] for k in priced]))


def separate(
    used: Sequence[tuple[int, Column, float]], cuts: Sequence[SubsetRow], single: Iterable[int], pois: Sequence[int],
) -> tuple[SubsetRow, ...]:
    """The cuts with those added, or widened, that a fractional solution violates most.

    Args:
        used: Its columns: unit, column and share.
        cuts: The cuts so far.
        single: Classes of one vehicle.
        pois: POIs that can be visited.
    """
    at = np.array(pois)
    visited = np.array([column.visits[at] > 0 for _, column, _ in used], dtype=np.float64)
    kinds = np.array([column.kind for _, column, _ in used])
    share = np.array([s for *_, s in used])
    pairs = (visited * share[:, None]).T @ visited
    found: list[tuple[float, tuple[int, ...], int | None]] = []
    size = len(at)
    for a in range(size):
        mine = visited[:, a] * share
        if mine.sum() < _VIOLATED:
            continue
        threefold = (visited * mine[:, None]).T @ visited
        over = pairs[a][:, None] + pairs[a][None, :] + pairs - 2 * threefold - 1
        for b, c in zip(*np.nonzero(np.triu(over, 1) > _VIOLATED), strict=True):
            if a < b:
                found.append((float(over[b, c]), (int(at[a]), int(at[b]), int(at[c])), None))
    for kind in single:
        own = kinds == kind
        alone = (visited[own] * share[own, None])
        both = alone.T @ visited[own]
        once = alone.sum(axis=0)
        over = once[:, None] + once[None, :] - 2 * both + pairs - 1
        for a, b in zip(*np.nonzero(np.triu(over, 1) > _VIOLATED), strict=True):
            found.append((float(over[a, b]), (int(at[a]), int(at[b])), int(kind)))
    found.sort(key=lambda entry: (-entry[0], entry[1], -1 if entry[2] is None else entry[2]))
    known = {(cut.pois, cut.kind): cut for cut in cuts}
    changed = 0
    for _, chosen, of_kind in found:
        if changed == A_ROUND:
            break
        old = known.get((chosen, of_kind))
        if old is None and len(known) == MOST_CUTS:
            continue
        memory = frozenset(chosen) | (old.memory if old else frozenset())
        for _, column, _ in used:
            if column.kind != of_kind:
                memory |= _between(column.route, chosen)
        if old is None or memory != old.memory:
            known[chosen, of_kind] = SubsetRow(pois=chosen, kind=of_kind, memory=memory)
            changed += 1
    return tuple(known.values())


def _between(route: Stops, pois: tuple[int, ...]) -> frozenset[int]:
    """Sites from each first of two visits to the second."""
    places = [k for k, j in enumerate(route) if j in pois]
    return frozenset(route[k] for first, second in zip(places[::2], places[1::2], strict=False)
                     for k in range(first, second + 1))
