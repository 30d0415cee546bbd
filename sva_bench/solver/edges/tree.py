"""Branch and cut on the edge model, with a search tree of its own; HiGHS solves the linear programs.

A node is pruned, and a column fixed, by bounds that are computed from the duals of its program (``program.py``), never
by a program that was stopped early.
"""

from __future__ import annotations

import itertools
import logging
import math
from dataclasses import dataclass

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.solver.edges.box import Box, Inspect
from sva_bench.solver.edges.branching import Branch, PseudoCosts, choose
from sva_bench.solver.edges.incumbent import Guide, Incumbent, is_integer
from sva_bench.solver.edges.program import EdgeProgram, Solved, WarmStart
from sva_bench.solver.edges.root import solve_root
from sva_bench.solver.edges.separation import violated_cuts
from sva_bench.solver.flow.undirected import UndirectedModel
from sva_bench.solver.knowledge import Cut
from sva_bench.solver.problem import Problem
from sva_bench.solver.units import LARGEST

_log = logging.getLogger(__name__)

_TOLERANCE = 0.06  # violation of a cut, of visits, at fractional points of nodes ...
_INTEGER_TOLERANCE = 1e-4  # ... and at integer ones
_MOST_CUTS = 20  # of a vehicle in a round
_ROUNDS = 8  # of cuts at a node
_STALL = 0.02  # of the node's gap: a round that gains less counts as idle
_IDLE_ROUNDS = 2
_SPARE_CUTS = 1.2  # of the model's rows: so many more than after the last purge cause another
GUIDED = {1: 1, 6: 1, 16: 1}
"""Searches of the heuristic at a node, by its number."""
GUIDED_EVERY = 25
"""Nodes between two searches later on."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Node:
    """An open node.

    Attributes:
        box: Its bounds.
        bound: Upper bound on its points.
        estimate: Estimated objective of its relaxation.
        warm: Basis of its parent.
    """

    box: Box
    bound: float
    estimate: float
    warm: WarmStart | None


def prove_by_tree(problem: Problem, guide: Guide | None = None, inspect: Inspect | None = None) -> None:
    """Prove the plan of ``problem.progress``, or a better one, within the gap, by branch and cut.

    Args:
        problem: The problem.
        guide: A heuristic for plans near a relaxation.
        inspect: Told of every pruning, for tests.
    """
    flow = UndirectedModel(problem.instance, problem.scopes, problem.goal, linked=False)
    size = float(np.abs(flow.model.objective).max(initial=0.0)) / LARGEST or 1.0
    upper = flow.model.upper.astype(np.int8)
    incumbent = Incumbent(flow=flow, problem=problem, size=size, box=Box(lower=np.zeros_like(upper), upper=upper),
                          guide=guide, inspect=inspect)
    progress, clock = problem.progress, problem.clock
    tree: Tree | None = None
    began = clock.used_s()
    try:
        root = solve_root(incumbent, flow.model.objective / size)
        progress.seconds["root"], began = clock.used_s() - began, clock.used_s()
        if root is not None:
            problem.known.cuts.update(dict.fromkeys(root[0].cuts))
            tree = Tree(incumbent, *root)
            tree.run()
        incumbent.tighten(-math.inf)
    except TimeoutError:
        progress.status = "time_limit"
    finally:
        progress.seconds["branch" if "root" in progress.seconds else "root"] = clock.used_s() - began
        if tree is not None:
            progress.rounds += tree.program.solves
            progress.cuts = len(tree.program.cuts)


class Tree:
    """The search: it dives into the better child, and goes on with the node of best bound."""

    def __init__(self, incumbent: Incumbent, program: EdgeProgram, root: Solved) -> None:
        self.program = program
        self._incumbent, self._flow = incumbent, incumbent.flow
        self._costs = PseudoCosts(len(program.objective))
        self._open: list[Node] = [Node(box=incumbent.box, bound=root.bound, estimate=root.bound, warm=None)]
        self._most_cuts = self._limit()

    def run(self) -> None:
        """Search until no node is left.

        Raises:
            TimeoutError: If time runs out.
        """
        progress, problem = self._incumbent.problem.progress, self._incumbent.problem
        following: Node | None = None
        for number in itertools.count(1):
            node = following or self._next()
            if node is None:
                return
            # What is open stays in the list until it is done: a bound is that of all of it.
            self._open.append(node)
            if problem.clock.is_over():
                raise TimeoutError
            progress.nodes += 1
            children = self._process(node, number)
            self._open.remove(node)
            following = None
            if children:
                children = sorted(children, key=lambda child: child.estimate)
                following = children.pop()
                self._open += children
            bounds = [each.bound for each in self._open] + [each.bound for each in [following] if each]
            self._incumbent.tighten(max(bounds, default=-math.inf))
            if _log.isEnabledFor(logging.DEBUG) and number % 20 == 0:
                _log.debug("node %d: bound %.6g, value %.6g, gap %.2f %%, %d open, %d cuts", number, progress.bound,
                           progress.value, 100 * (progress.bound / progress.value - 1) if progress.value else math.nan,
                           len(self._open), len(self.program.cuts))
            if progress.closed(problem.gap):
                return

    def _next(self) -> Node | None:
        """The open node of greatest bound, taken off the list."""
        while self._open:
            node = max(self._open, key=lambda each: (each.bound, each.estimate))
            self._open.remove(node)
            if node.bound > self._incumbent.cutoff:
                return node
            self._incumbent.pruned(node.box)
        return None

    def _process(self, node: Node, number: int) -> list[Node]:
        """Solve a node: its children; none if it holds no better plan.

        Raises:
            TimeoutError: If time runs out.
        """
        incumbent, program = self._incumbent, self.program
        box, bound = node.box.within(incumbent.box), node.bound
        if node.warm is not None:
            program.start_from(node.warm)
        searches = GUIDED.get(number, int(number % GUIDED_EVERY == 0))
        rounds, idle = 0, 0
        while True:
            if box.is_empty:
                incumbent.pruned(box)
                return []
            program.set_box(box)
            solved = self._solve(box)
            if solved is None:
                return []
            if solved.status == "unclear":
                return self._halves(box, bound)
            gained, bound = bound - solved.bound, min(bound, solved.bound)
            box = self._narrowed(box, solved)
            values = solved.values
            integer = is_integer(values)
            cuts = self._violated(values, integer)
            if integer and not cuts:
                if incumbent.offer(np.rint(values), solved.bound) or solved.bound <= incumbent.cutoff:
                    incumbent.pruned(box)
                    return []
                return self._halves(box, bound)
            gap = bound - incumbent.cutoff
            idle = idle + 1 if rounds and gained < _STALL * gap else 0
            if cuts and (integer or (rounds < _ROUNDS and idle < _IDLE_ROUNDS)):
                program.add_cuts(cuts)
                rounds += 1
                continue
            if searches:
                times, searches, before = searches, 0, incumbent.cutoff
                incumbent.search(values, times)
                if incumbent.cutoff > before:
                    box = self._narrowed(box.within(incumbent.box), solved)
                    continue
            if len(program.cuts) > self._most_cuts:
                self._purge(box)
                program = self.program
                continue  # reduced costs need the duals of the rows that are left
            program.set_box(box)
            chosen = choose(program, self._costs, values, box, solved.bound, incumbent.cutoff,
                            incumbent.problem.clock)
            if isinstance(chosen, Branch):
                return self._children(box, bound, chosen)
            for column, least, is_upper in chosen:
                after = _cut_off(box, column, least, is_upper)
                incumbent.pruned(box, after)
                box = after

    def _solve(self, box: Box) -> Solved | None:
        """Solve the program over a box; ``None`` if it holds no better plan.

        Raises:
            TimeoutError: If time runs out.
        """
        solved = self.program.solve(self._incumbent.problem.clock.left_s(), self._incumbent.cutoff)
        if solved.status == "time_limit":
            raise TimeoutError
        if solved.status == "empty":
            self._incumbent.pruned(box)
            return None
        return solved

    def _narrowed(self, box: Box, solved: Solved) -> Box:
        """The part of a node that can hold a better plan, by reduced costs."""
        after = box.above(self._incumbent.cutoff, solved.bound, solved.reduced)
        self._incumbent.pruned(box, after)
        return after

    def _violated(self, values: FloatArray, integer: bool) -> list[Cut]:
        if integer:
            return violated_cuts(self._flow, np.rint(values), tolerance=_INTEGER_TOLERANCE)
        present = set(self.program.cuts)
        return [cut for cut in violated_cuts(self._flow, values, tolerance=_TOLERANCE, most=_MOST_CUTS)
                if cut not in present]

    def _children(self, box: Box, bound: float, branch: Branch) -> list[Node]:
        warm = self.program.warm_start()
        return [Node(box=part, bound=min(bound, own), estimate=bound - max(loss, 0.0), warm=warm)
                for part, loss, own in zip(box.split(branch.column, branch.least), branch.losses, branch.bounds,
                                           strict=True)]

    def _halves(self, box: Box, bound: float) -> list[Node]:
        """Divide a node by a column that is not fixed, whichever; if there is none, its point is all that it holds."""
        free = np.flatnonzero(box.free)
        if not len(free):
            self._incumbent.offer(box.lower.astype(np.float64), bound)
            self._incumbent.pruned(box)
            return []
        column = int(free[0])
        return [Node(box=part, bound=bound, estimate=bound, warm=None)
                for part in box.split(column, int(box.lower[column]) + 1)]

    def _limit(self) -> float:
        return len(self.program.cuts) + _SPARE_CUTS * len(self._flow.model.rows.lower)

    def _purge(self, box: Box) -> None:
        """Drop the cuts that don't matter at the node, and columns that no better plan has."""
        before = len(self.program.cuts)
        self.program = self.program.over(self._incumbent.columns, self.program.tight_cuts())
        self.program.set_box(box)
        self._most_cuts = self._limit()
        _log.debug("%d of %d cuts kept", len(self.program.cuts), before)


def _cut_off(box: Box, column: int, least: int, is_upper: bool) -> Box:
    """A box without the part at or above, or below, a value of a column."""
    lower, upper = box.lower.copy(), box.upper.copy()
    if is_upper:
        upper[column] = min(upper[column], least - 1)
    else:
        lower[column] = max(lower[column], least)
    return Box(lower=lower, upper=upper)
