"""Plans as the heuristics hold them: POIs of each vehicle in order of visit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sva_bench.arrays import IntArray
from sva_bench.solver.routes.packing import Route

VisitOrders = tuple[tuple[int, ...], ...]
"""POIs of each vehicle, in order of visit."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Found:
    """The result of a search.

    Attributes:
        orders: The best plan.
        routes: The routes of greatest reduced cost in the set-packing relaxation, each with its vehicle.
    """

    orders: VisitOrders
    routes: tuple[Route, ...]


def as_arrays(orders: VisitOrders, n: int) -> tuple[IntArray, IntArray]:
    """A plan as POIs of each vehicle, shape (M, n), and how many they are, shape (M,)."""
    array, length = np.zeros((len(orders), n), np.int64), np.array([len(order) for order in orders], dtype=np.int64)
    for m, order in enumerate(orders):
        array[m, :len(order)] = order
    return array, length


def as_orders(array: IntArray, length: IntArray) -> VisitOrders:
    """The plan of such arrays."""
    return tuple(tuple(array[m, :length[m]].tolist()) for m in range(len(length)))
