"""Subset-row cuts: of three rows with right-hand side 1, at most one route covers two.

The rows are those of three POIs, or of two POIs and a vehicle. With limited memory, a route that passes a site outside
a cut's memory loses its first visit there and has coefficient 0, so that few labels of pricing carry the cut's state.

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
_BITS = 64  # cuts whose state a label carries, one bit each
A_ROUND = 20  # cuts added or extended at a time
_VIOLATED = 0.03  # least violation of a cut that is added


@dataclass(frozen=True, kw_only=True)
class SubsetRow:
    """A subset-row cut with limited memory.

    Attributes:
        pois: Its members: three POIs, or two.
        vehicle_class: With two POIs, the class of one vehicle whose row is the third; else ``None``.
        memory: Sites at which a first visit is kept.
    """

    pois: tuple[int, ...]
    vehicle_class: int | None
    memory: frozenset[int]


class Counter:
    """The coefficients of cuts for routes."""

    def __init__(self, cuts: Sequence[SubsetRow], n: int) -> None:
        self._member, self._memory = np.zeros((len(cuts), n), dtype=np.bool_), np.zeros((len(cuts), n), dtype=np.bool_)
        for k, cut in enumerate(cuts):
            self._member[k, list(cut.pois)], self._memory[k, list(cut.memory)] = True, True
        self._kind = np.array([-1 if cut.vehicle_class is None else cut.vehicle_class for cut in cuts], dtype=np.int64)

    def of(self, vehicle_class: int, route: Stops) -> FloatArray:
        """Coefficient of each cut for a route of a class, shape (cuts,)."""
        counted: FloatArray = counts(self._member, self._memory, self._kind == vehicle_class, np.array(route))
        return counted


@dataclass(frozen=True, eq=False, kw_only=True)
class CutDuals:
    """Duals of the cuts for the routes of a vehicle class; sets of cuts are bits, for compiled labels.

    Attributes:
        in_cut: Cuts of which a site is a member, shape (n,).
        in_memory: Cuts in whose memory a site is, shape (n,).
        at_first_visit: Cuts whose dual is subtracted at the first visit alone; that of the others at each second one.
        dual: Dual of each, positive, shape (cuts,).
    """

    in_cut: NDArray[np.uint64]
    in_memory: NDArray[np.uint64]
    at_first_visit: np.uint64
    dual: FloatArray


def cut_duals_of(cuts: Sequence[SubsetRow], duals: FloatArray, vehicle_class: int, n: int) -> CutDuals:
    """The duals of the cuts, shape (cuts,), for the routes of a vehicle class."""
    in_cut, in_memory, at_first_visit = np.zeros(n, dtype=np.uint64), np.zeros(n, dtype=np.uint64), 0
    # A cut beyond the bits is priced with dual 0: reduced values are then no lower, and bounds stay valid.
    priced = [int(k) for k in np.argsort(-duals, kind="stable")[:_BITS] if duals[k] > 0.0]
    for number, k in enumerate(priced):
        bit = np.uint64(1) << np.uint64(number)
        in_cut[list(cuts[k].pois)] |= bit
        if cuts[k].vehicle_class == vehicle_class:
            at_first_visit |= 1 << number
            in_memory |= bit
        else:
            in_memory[list(cuts[k].memory)] |= bit
    return CutDuals(in_cut=in_cut, in_memory=in_memory, at_first_visit=np.uint64(at_first_visit),
                    dual=np.array([duals[k] for k in priced]))


def separate(
    used: Sequence[tuple[int, Column, float]], cuts: Sequence[SubsetRow], single: Iterable[int], pois: Sequence[int],
) -> tuple[SubsetRow, ...]:
    """The cuts, with those that a fractional solution violates most added or extended in memory.

    Args:
        used: The solution's columns: vehicle group, column and value.
        cuts: The cuts so far.
        single: Classes of a single vehicle.
        pois: POIs that can be visited.
    """
    at = np.array(pois)
    visited = np.array([column.visits[at] > 0 for _, column, _ in used], dtype=np.float64)
    classes = np.array([column.vehicle_class for _, column, _ in used])
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
    for vehicle_class in single:
        own = classes == vehicle_class
        alone = (visited[own] * share[own, None])
        both = alone.T @ visited[own]
        visits_each = alone.sum(axis=0)
        over = visits_each[:, None] + visits_each[None, :] - 2 * both + pairs - 1
        for a, b in zip(*np.nonzero(np.triu(over, 1) > _VIOLATED), strict=True):
            found.append((float(over[a, b]), (int(at[a]), int(at[b])), int(vehicle_class)))
    found.sort(key=lambda entry: (-entry[0], entry[1], -1 if entry[2] is None else entry[2]))
    known = {(cut.pois, cut.vehicle_class): cut for cut in cuts}
    changed = 0
    for _, chosen, cut_class in found:
        if changed == A_ROUND:
            break
        old = known.get((chosen, cut_class))
        if old is None and len(known) == MOST_CUTS:
            continue
        memory = frozenset(chosen) | (old.memory if old else frozenset())
        for _, column, _ in used:
            if column.vehicle_class != cut_class:
                memory |= _between(column.route, chosen)
        if old is None or memory != old.memory:
            known[chosen, cut_class] = SubsetRow(pois=chosen, vehicle_class=cut_class, memory=memory)
            changed += 1
    return tuple(known.values())


def _between(route: Stops, pois: tuple[int, ...]) -> frozenset[int]:
    """Sites of a route from each odd visit to a cut's members to the next even one: the memory the cut needs."""
    places = [k for k, j in enumerate(route) if j in pois]
    return frozenset(route[k] for first, second in zip(places[::2], places[1::2], strict=False)
                     for k in range(first, second + 1))
