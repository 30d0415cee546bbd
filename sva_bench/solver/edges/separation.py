"""Generalised subtour cuts that a point of the edge model violates: all of them that minimum cuts find."""

from __future__ import annotations

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.interrupts import deferring_ctrl_c
from sva_bench.solver.edges.max_flow import minimum_cuts
from sva_bench.solver.flow.undirected import UndirectedModel
from sva_bench.solver.knowledge import Cut

_SUPPORT = 1e-7  # an edge driven less is none


def violated_cuts(flow: UndirectedModel, values: FloatArray, *, tolerance: float, most: int | None = None) -> list[Cut]:
    """Cuts ``x(edges out of S) >= 2 s_i`` that a point violates: both sides of the minimum cut of every POI.

    Args:
        flow: The model.
        values: The point, shape (columns,).
        tolerance: Violation of ``x / 2 >= s`` from which a cut counts.
        most: Cuts of each vehicle, the most violated ones; ``None`` = all.
    """
    cuts: list[Cut] = []
    used = np.flatnonzero((values > _SUPPORT) & (flow.ends[:, 0] >= 0))
    n = flow.edge.shape[1]
    for m, visit in enumerate(flow.visit):
        mine = used[flow.vehicle[used] == m]
        visits = np.where(visit >= 0, values[visit], 0.0)
        demand = 2 * (visits - tolerance)
        with deferring_ctrl_c():
            sets, across = minimum_cuts(n, flow.ends[mine], values[mine], flow.base, demand)
        if not len(sets):
            continue
        poi = np.where(sets, visits[None, :], -1.0).argmax(axis=1)  # the cut that S violates most
        short = visits[poi] - across / 2
        found: dict[Cut, None] = {}
        for k in np.argsort(-short, kind="stable"):
            inside = tuple(np.flatnonzero(sets[k]).tolist())
            found[Cut(vehicle=m, inside=inside, poi=int(poi[k]))] = None
            if most is not None and len(found) == most:
                break
        cuts += found
    return cuts
