"""What the duals of cuts take from the reduced costs of edges and visits; compiled."""

from __future__ import annotations

from numba import njit

WITHIN, ACROSS, OUTSIDE = range(3)
"""Over which edges a cut is written."""


@njit(cache=True)
def subtract_cuts(columns, ends, vehicle, visit, leaves, of, inside, poi, over, duals, reduced):
    """Subtract the products of the cuts' columns with their duals from reduced costs, in place.

    Args:
        columns: The edges of interest, as columns of the model, shape (edges,).
        ends: Sites that each column of the model joins, shape (columns, 2).
        vehicle: Vehicle of each column of the model, shape (columns,).
        visit: Column s of each vehicle and site, -1 = none, shape (M, n).
        leaves: Column u of each vehicle, shape (M,).
        of: Vehicle of each cut, shape (cuts,).
        inside: Whether a site is in the set S of a cut, shape (cuts, n).
        poi: POI of each cut, shape (cuts,).
        over: Over which edges each cut is written, shape (cuts,).
        duals: Duals of the cuts, shape (cuts,).
        reduced: Reduced costs, shape (columns of the model,).
    """
    n = inside.shape[1]
    for k in range(len(duals)):
        y = duals[k]
        if y == 0.0:
            continue
        m, wanted = of[k], 2 - over[k]
        for column in columns:
            if vehicle[column] == m and inside[k, ends[column, 0]] + inside[k, ends[column, 1]] == wanted:
                reduced[column] -= y
        if over[k] == ACROSS:
            reduced[visit[m, poi[k]]] += 2 * y
            continue
        for j in range(n):
            if visit[m, j] >= 0 and inside[k, j] == (over[k] == WITHIN):
                reduced[visit[m, j]] += y
        reduced[visit[m, poi[k]]] -= y
        if over[k] == OUTSIDE:
            reduced[leaves[m]] += y
