"""Connectivity cuts: ``y(out of S) >= y(into i)`` for every POI i in S, per vehicle (constraint (3), generalised).

They hold for every route of every vehicle, whatever the objective, so a cut found once serves all later solves.
The only importer of networkx.
"""

from __future__ import annotations

from collections.abc import Iterable

import networkx
import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from sva_bench.arrays import FloatArray
from sva_bench.solver.flow.formulation import Legs
from sva_bench.solver.knowledge import Cut
from sva_bench.solver.program import Rows

TOLERANCE = 0.02  # violation below which a fractional cut costs more than it gains
CUTS_A_ROUND = 20  # per vehicle
_SCALE = 1_000_000  # the maximum flow is computed in integers


def cut_rows(cuts: Iterable[Cut], legs: Legs, n: int) -> Rows:
    """The cuts as rows over the columns of a model; a cut whose POI the vehicle can't visit becomes empty."""
    start, column, value = [0], [], []
    for cut in cuts:
        within = np.zeros(n, dtype=np.bool_)
        within[list(cut.inside)] = True
        mine = legs.vehicle == cut.vehicle
        entries = (mine & within[legs.origin] & ~within[legs.destination]).astype(np.float64)
        entries -= mine & (legs.destination == cut.poi)
        used = np.flatnonzero(entries)
        column.append(used)
        value.append(entries[used])
        start.append(start[-1] + len(used))
    return Rows(
        lower=np.zeros(len(start) - 1), upper=np.full(len(start) - 1, np.inf), start=np.array(start, dtype=np.int64),
        column=np.concatenate([np.zeros(0, dtype=np.int64), *column]), value=np.concatenate([np.zeros(0), *value]),
    )


def violated_by_integers(visits: FloatArray, vehicle: int, base: int, pois: frozenset[int]) -> list[Cut]:
    """Cuts for the components of an integer solution that aren't connected with the base.

    Args:
        visits: How often the vehicle drives each leg, ``y``, shape (n, n).
        vehicle: Number of the vehicle.
        base: The base.
        pois: The POIs.
    """
    graph = networkx.DiGraph()
    graph.add_edges_from((int(i), int(j)) for i, j in np.argwhere(visits > 0.25))
    parts = sorted(tuple(sorted(part)) for part in networkx.strongly_connected_components(graph))
    return [Cut(vehicle=vehicle, inside=part, poi=i) for part in parts if base not in part for i in part if i in pois]


def violated_by_fractions(visits: FloatArray, vehicle: int, base: int, pois: frozenset[int]) -> list[Cut]:
    """Cuts that a fractional solution violates: a minimum cut between the base and each POI that is visited in part.

    Args:
        visits: How often the vehicle drives each leg, ``y``, shape (n, n).
        vehicle: Number of the vehicle.
        base: The base.
        pois: The POIs.
    """
    capacity = np.rint(np.where(visits > 1e-7, visits, 0.0) * _SCALE).astype(np.int32)
    network = csr_array(capacity)
    entering = visits.sum(axis=0)
    wanted = sorted((i for i in pois if entering[i] > TOLERANCE), key=lambda i: (-entering[i], i))
    cuts: list[Cut] = []
    covered: set[int] = set()
    for poi in wanted:
        if len(cuts) == CUTS_A_ROUND:
            break
        if poi in covered:
            continue
        flow = maximum_flow(network, base, poi)
        if flow.flow_value / _SCALE < entering[poi] - TOLERANCE:
            residual = csr_array(capacity - flow.flow.toarray() > 0)
            inside = breadth_first_order(csr_array(residual.T), poi, return_predecessors=False)
            part = tuple(sorted(int(i) for i in inside))
            covered.update(part)
            cuts.append(Cut(vehicle=vehicle, inside=part, poi=poi))
    return cuts
