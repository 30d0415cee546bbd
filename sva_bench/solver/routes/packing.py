"""The best combination of given routes: a set-packing program."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.solver.highs import Relaxation, maximise
from sva_bench.solver.program import LinearModel, Rows
from sva_bench.solver.routes.fronts import LegTables
from sva_bench.solver.routes.worth import Worth

Route = tuple[int, tuple[int, ...]]
"""Vehicle class or vehicle that drives it, and its POIs in order."""

MOST_COLUMNS = 600
MOST_GOOD = 200
_NODES = 20  # branch-and-bound nodes: more are rarely worth their time
_EPSILON = 1e-9


def best_packing(
    tables: LegTables, worth: Worth, routes: Sequence[Route],
    incumbent: tuple[tuple[int, ...], ...],
) -> tuple[tuple[tuple[int, ...], ...], tuple[Route, ...]]:
    """The best plan of these routes, or the incumbent, and the routes of greatest reduced cost.

    Each route is a column for every vehicle of its class; branch and bound is limited, so the plan isn't proved.

    Args:
        tables: The legs of all vehicle classes.
        worth: What routes are worth.
        routes: The routes, each with its vehicle class.
        incumbent: A feasible plan, whose routes are columns too.

    Returns:
        POIs of each vehicle in order; and at most ``MOST_GOOD`` routes, each with its vehicle.

    Raises:
        KeyboardInterrupt: If Ctrl-C ended the solve.
    """
    vehicles, n = worth.weights.shape
    offers: dict[tuple[int, frozenset[int]], tuple[float, tuple[int, ...]]] = {}
    for m, order in (*enumerate(incumbent), *((m, order) for vehicle_class, order in routes
                                              for m in range(vehicles) if tables.vehicle_class[m] == vehicle_class)):
        value, key = worth.of_route(m, order), (m, frozenset(order))
        if value > offers.get(key, (_EPSILON, ()))[0]:
            offers[key] = (value, order)
    columns = [(m, visited, value, order) for (m, visited), (value, order) in offers.items()]
    if not columns:
        return incumbent, ()
    start = np.array([float(order == incumbent[m]) for m, _, _, order in columns])
    objective = np.array([value for _, _, value, _ in columns])
    model = _program(columns, objective, vehicles, n)
    relaxed = Relaxation(model).solve(np.inf)
    if relaxed.values is None:
        return incumbent, ()
    ranked = np.argsort(-relaxed.reduced, kind="stable")[:MOST_COLUMNS]
    good = tuple((columns[k][0], columns[k][3]) for k in np.sort(ranked[:MOST_GOOD]))
    room = relaxed.objective - float(objective @ start)
    if room <= _EPSILON * relaxed.objective:
        return incumbent, good
    kept = [int(k) for k in np.sort(ranked) if relaxed.reduced[k] >= -room - 1e-6 or start[k]]
    kept = sorted({*kept, *np.flatnonzero(start).tolist()})
    columns = [columns[k] for k in kept]
    outcome = maximise(_program(columns, objective[kept], vehicles, n), Rows.none(), gap=1e-9, absolute_gap=0.0,
                       time_limit_s=np.inf, start=start[kept], most_nodes=_NODES)
    if outcome.status == "interrupted":
        raise KeyboardInterrupt
    if outcome.values is None:
        return incumbent, good
    plan: list[tuple[int, ...]] = [()] * vehicles
    for chosen in np.flatnonzero(outcome.values > 0.5):
        m, _, _, visits = columns[chosen]
        plan[m] = visits
    return tuple(plan), good


def _program(
    columns: Sequence[tuple[int, frozenset[int], float, tuple[int, ...]]], objective: FloatArray, vehicles: int, n: int,
) -> LinearModel:
    """The set-packing program: each POI and each vehicle at most once."""
    rows: list[list[int]] = [[] for _ in range(n + vehicles)]
    for number, (m, visited, _, _) in enumerate(columns):
        rows[n + m].append(number)
        for j in visited:
            rows[j].append(number)
    rows = [row for row in rows if row]
    start = np.cumsum([0, *(len(row) for row in rows)])
    return LinearModel(
        objective=objective, upper=np.ones(len(columns)), integer=np.ones(len(columns), dtype=np.bool_),
        rows=Rows(lower=np.full(len(rows), -np.inf), upper=np.ones(len(rows)), start=start.astype(np.int64),
                  column=np.array([k for row in rows for k in row], dtype=np.int64), value=np.ones(int(start[-1]))))
