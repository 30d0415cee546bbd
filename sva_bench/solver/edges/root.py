"""The root of the tree: the relaxation with all cuts that it violates, solved over few edges, the others priced."""

from __future__ import annotations

import logging
import math

import numpy as np

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.solver.edges.incumbent import Incumbent
from sva_bench.solver.edges.program import EdgeProgram, Solved
from sva_bench.solver.edges.separation import violated_cuts
from sva_bench.solver.flow.undirected import UndirectedModel
from sva_bench.solver.knowledge import Cut

_log = logging.getLogger(__name__)

_NEAREST = 8  # edges of each site that the first program has
_TOLERANCE = 0.01  # violation of a cut, of visits
_STALL = 0.002  # of the gap: a round that gains less counts as idle
_IDLE_ROUNDS = 6
_PRICED = 1e-7  # reduced cost of an edge that counts as none
_MOST_PRICED = 4  # edges that come in at a time, for each site and vehicle


def solve_root(incumbent: Incumbent, objective: FloatArray) -> tuple[EdgeProgram, Solved] | None:
    """The program over all columns that can be in a better plan, and its optimum; ``None`` if there is none.

    Args:
        incumbent: The incumbent, whose box is tightened.
        objective: Objective in the unit of the programs, shape (columns,).

    Raises:
        TimeoutError: If time runs out.
    """
    flow, clock, progress = incumbent.flow, incumbent.problem.clock, incumbent.problem.progress
    cuts = [cut for cut in incumbent.problem.known.cuts if flow.visit[cut.vehicle, cut.poi] >= 0]
    program = EdgeProgram(flow, objective, _first_columns(incumbent), cuts)
    idle, last = 0, math.inf
    while True:
        if clock.is_over():
            raise TimeoutError
        solved = program.solve(clock.left_s())
        progress.rounds += 1
        if solved.status == "time_limit":
            raise TimeoutError
        missing = _missing(program, incumbent)
        if solved.status != "optimal":
            if len(missing):  # the few edges of the first program may hold no plan
                program.add_columns(missing)
                continue
            if solved.status == "unclear":
                raise RuntimeError("HiGHS: the relaxation of the edge model has no solution, but no proof of it")
            incumbent.pruned(incumbent.box)
            return None
        incumbent.tighten(solved.bound)
        incumbent.narrow(solved.bound, solved.reduced)
        if incumbent.box.is_empty or solved.bound <= incumbent.cutoff:
            incumbent.pruned(incumbent.box)
            return None
        program.set_box(incumbent.box)
        priced = missing[solved.reduced[missing] > _PRICED]
        priced = priced[np.argsort(-solved.reduced[priced], kind="stable")]
        present = set(program.cuts)
        new = [cut for cut in violated_cuts(flow, solved.values, tolerance=_TOLERANCE) if cut not in present]
        if not len(priced):
            idle = idle + 1 if last - solved.bound < _STALL * (solved.bound - incumbent.cutoff) else 0
            last = solved.bound
            if not new or idle >= _IDLE_ROUNDS:
                break
        if len(priced):
            program.add_columns(priced[:_MOST_PRICED * flow.visit.size])
        program.add_cuts(new)
    tight = program.tight_cuts()
    _log.debug("root: bound %.6g, value %.6g, %d of %d cuts tight, %d LPs", progress.bound, progress.value,
               len(tight), len(program.cuts), program.solves)
    return _polished(program, incumbent, tight)


def _polished(program: EdgeProgram, incumbent: Incumbent, cuts: list[Cut]) -> tuple[EdgeProgram, Solved] | None:
    """The program over all columns that are left, with the given cuts alone, and its optimum.

    Raises:
        TimeoutError: If time runs out.
    """
    program = program.over(incumbent.columns, cuts)
    program.set_box(incumbent.box)
    solved = program.solve(incumbent.problem.clock.left_s(), incumbent.cutoff)
    if solved.status == "time_limit":
        raise TimeoutError
    if solved.status == "empty":
        incumbent.pruned(incumbent.box)
        return None
    if solved.status == "optimal":
        incumbent.tighten(solved.bound)
        incumbent.narrow(solved.bound, solved.reduced)
        incumbent.roots.append((solved.bound, solved.reduced))
    return program, solved


def _missing(program: EdgeProgram, incumbent: Incumbent) -> IntArray:
    """Columns that a better plan may have, but the program has not."""
    there = np.zeros(len(program.objective), dtype=np.bool_)
    there[program.columns] = True
    return np.flatnonzero(~there & (incumbent.box.upper > 0))


def _first_columns(incumbent: Incumbent) -> IntArray:
    """Visits, and the edges at the base, between near sites, and of the incumbent."""
    flow: UndirectedModel = incumbent.flow
    use = flow.ends[:, 0] < 0
    use |= (flow.ends == flow.base).any(axis=1)
    for m, scope in enumerate(incumbent.problem.scopes):
        edge = flow.edge[m]
        time = np.where(edge >= 0, scope.leg_time_s, np.inf)
        near = np.argsort(time, axis=1, kind="stable")[:, :_NEAREST]
        found = np.take_along_axis(edge, near, axis=1)
        use[found[found >= 0]] = True
    point = flow.point(incumbent.problem.progress.orders)
    if point is not None:
        use |= point > 0
    return np.flatnonzero(use)
