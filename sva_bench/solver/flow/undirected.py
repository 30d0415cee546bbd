"""The collapsed model with a column for each edge: symmetric costs, and no refuelling during the mission.

Columns per vehicle: ``u``, whether it leaves the base; ``s_j``, whether it visits POI j; ``x_e``, how often it drives
edge e. Rows: ``x(edges at the base) = 2 u``, ``x(edges at j) = 2 s_j``, ``sum_e t_e x_e <= limit u``, and each POI once
over all vehicles. Half as many columns as the directed model, and a tighter relaxation: both directions of a route are
one point. A cut ``x(edges out of S) >= 2 s_i`` is written over the edges within S, where those are fewer.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.mission.instance import Instance
from sva_bench.solver.goal import Goal, sizes_of
from sva_bench.solver.knowledge import Cut
from sva_bench.solver.preprocess import SLACK_S, Scope
from sva_bench.solver.program import LinearModel, RowBuilder, Rows
from sva_bench.solver.routes.heuristic import VisitOrders


class UndirectedModel:
    """The edge model of one goal: a ``FlowModel`` of ``branch_and_cut``.

    Args:
        instance: The instance.
        scopes: What each vehicle may do.
        goal: Objective and floors.
        linked: Whether it has the rows ``s_j <= u``, which are cuts too: of all sites but the base.

    Attributes:
        model: The linear model.
        base: The base.
        leaves: Column u of each vehicle, shape (M,).
        visit: Column s of vehicle m and site j, -1 = none, shape (M, n).
        edge: Column x of vehicle m between two sites, -1 = none, shape (M, n, n).
        vehicle: Vehicle of each column, shape (columns,).
        ends: Sites that a column x joins; -1 for other columns, shape (columns, 2).
    """

    def __init__(self, instance: Instance, scopes: Sequence[Scope], goal: Goal, *, linked: bool = True) -> None:
        self._instance, self._scopes = instance, scopes
        n, base, pois = len(instance.sites), instance.base, instance.pois
        half = instance.stop_s[:, None] / 2 + instance.stop_s[None, :] / 2
        build = RowBuilder()
        objective: list[float] = []
        upper: list[float] = []
        leaves: list[int] = []
        joins: list[IntArray] = [np.zeros((0, 2), dtype=np.int64)]
        self.base = base
        self.visit: IntArray = np.full((len(scopes), n), -1)
        self.edge: IntArray = np.full((len(scopes), n, n), -1)
        for m, scope in enumerate(scopes):
            time = scope.leg_time_s + half
            ends = np.argwhere(np.triu(scope.legs))
            reachable = [j for j in pois if scope.legs[j].any()]
            first = len(objective)
            leaves.append(first)
            self.visit[m, reachable] = first + 1 + np.arange(len(reachable))
            edges = first + 1 + len(reachable) + np.arange(len(ends))
            self.edge[m, ends[:, 0], ends[:, 1]] = self.edge[m, ends[:, 1], ends[:, 0]] = edges
            joins += [np.full((1 + len(reachable), 2), -1), ends]
            costs = time[ends[:, 0], ends[:, 1]]
            objective += [0.0, *goal.weights[m, reachable], *(-goal.driving * costs)]
            upper += [1.0] * (1 + len(reachable)) + np.where((ends == base).any(axis=1), 2.0, 1.0).tolist()
            for site in (base, *reachable):
                of_site = self.edge[m, site][self.edge[m, site] >= 0]
                total = first if site == base else int(self.visit[m, site])
                build.add([*of_site, total], [1.0] * len(of_site) + [-2.0], 0.0, 0.0)
            size = max(scope.limit_s, 1.0)
            build.add([*edges, first], [*(costs / size), -(scope.limit_s + SLACK_S) / size], -np.inf, 0.0)
            for j in reachable if linked else ():
                build.add([int(self.visit[m, j]), first], [1.0, -1.0], -np.inf, 0.0)
        for j in pois:
            of_poi = self.visit[:, j][self.visit[:, j] >= 0]
            if len(of_poi) > 1:
                build.add(of_poi, np.ones(len(of_poi)), -np.inf, 1.0)
        for (weights, floor), size in zip(goal.floors, sizes_of(goal.floors), strict=True):
            used = np.argwhere((self.visit >= 0) & (weights != 0))
            build.add(self.visit[used[:, 0], used[:, 1]], weights[used[:, 0], used[:, 1]] / size, floor / size, np.inf)
        self.leaves: IntArray = np.array(leaves, dtype=np.int64)
        self.ends: IntArray = np.concatenate(joins)
        self.vehicle: IntArray = np.searchsorted(self.leaves, np.arange(len(objective)), side="right") - 1
        self.model = LinearModel(objective=np.array(objective), upper=np.array(upper),
                                 integer=np.ones(len(objective), dtype=np.bool_), rows=build.rows())

    def rows(self, cuts: Sequence[Cut]) -> Rows:
        """The connectivity cuts as rows over the model's columns."""
        build = RowBuilder()
        for cut in cuts:
            inside = np.array([j for j in cut.inside if self.visit[cut.vehicle, j] >= 0], dtype=np.int64)
            visit = int(self.visit[cut.vehicle, cut.poi])
            if visit < 0:
                build.add([], [], -np.inf, np.inf)
                continue
            edge = self.edge[cut.vehicle]
            within = _positive(np.triu(edge[np.ix_(inside, inside)], 1))
            outside = np.setdiff1d(np.arange(len(edge)), inside)
            across = _positive(edge[np.ix_(inside, outside)])
            others = self.visit[cut.vehicle, inside[inside != cut.poi]]
            if len(within) + len(others) < len(across):
                build.add([*within, *others], [1.0] * len(within) + [-1.0] * len(others), -np.inf, 0.0)
            else:
                build.add([*across, visit], [1.0] * len(across) + [-2.0], 0.0, np.inf)
        return build.rows()

    def visits(self, values: FloatArray, vehicle: int) -> FloatArray:
        """How often a vehicle drives each edge, half of it in either direction, shape (n, n)."""
        edge = self.edge[vehicle]
        return np.where(edge >= 0, values[edge], 0.0) / 2

    def order(self, values: FloatArray, vehicle: int) -> tuple[int, ...]:
        """POIs of a vehicle's route, in order of visit."""
        left = np.rint(2 * self.visits(values, vehicle))
        here = self._instance.base
        order: list[int] = []
        while True:
            onward = np.flatnonzero(left[here] > 0.5)
            if not len(onward):
                return tuple(order)
            there = int(onward[0])
            left[here, there] -= 1
            left[there, here] -= 1
            if there == self._instance.base:
                return tuple(order)
            order.append(there)
            here = there

    def point(self, orders: VisitOrders) -> FloatArray | None:
        """A plan as a point of the model; ``None`` where it uses an edge that the model leaves out."""
        point = np.zeros(len(self.model.objective))
        for m, order in enumerate(orders):
            if not order:
                continue
            point[self.leaves[m]] = 1.0
            stops = (self._instance.base, *order, self._instance.base)
            for i, j in itertools.pairwise(stops):
                if self.edge[m, i, j] < 0:
                    return None
                point[self.edge[m, i, j]] += 1.0
            point[self.visit[m, list(order)]] = 1.0
        return point


def serves(instance: Instance, scopes: Sequence[Scope]) -> bool:
    """Whether times are symmetric for all vehicles and none can refuel: what the edge model requires."""
    return not lacking(instance, scopes)


def lacking(instance: Instance, scopes: Sequence[Scope]) -> str:
    """What the edge model requires and an instance lacks; nothing where it serves."""
    stations = list(instance.stations)
    for scope in scopes:
        if not np.isfinite(scope.limit_s):
            return "a vehicle has no mission limit"
        if np.isfinite(scope.capacity_s) or scope.legs[stations].any():
            return "fuel may run short, or a vehicle refuel"
        if not (np.array_equal(scope.legs, scope.legs.T)
                and np.array_equal(scope.leg_time_s[scope.legs], scope.leg_time_s.T[scope.legs])):
            return "a leg takes another time than the way back"
    return ""


def _positive(columns: IntArray) -> IntArray:
    """The column numbers among entries; -1, and the 0 of a triangle's other half, stand for no column."""
    found: IntArray = columns[columns > 0]
    return found
