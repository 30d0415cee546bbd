"""HiGHS: linear and mixed-integer programs. The only importer of highspy; arrays in, arrays out."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from threading import Event, Thread
from typing import Any, Literal

import highspy
import numpy as np

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.interrupts import deferring_ctrl_c, heard_ctrl_c, pressed
from sva_bench.solver.program import LinearModel, MipResult, Relaxed, Rows, SolveStatus

_LARGE = 20_000  # entries of a linear program that may take long enough to be interrupted
_AGGREGATOR = 1 << 12  # HiGHS's number of this rule of presolve
_POLL_S = 0.1  # between two polls for Ctrl-C
_FEWEST_ITERATIONS, _MOST_ITERATIONS = 100, 5000  # of the simplex method, between two chances to hear Ctrl-C ...
_WORK = 50_000_000  # ... and in between so many, divided by the entries of the program: some tenths of a second

EndOfSimplex = Literal["optimal", "cutoff", "infeasible", "iterations", "time_limit"]
_ENDS: dict[Any, EndOfSimplex] = {
    highspy.HighsModelStatus.kOptimal: "optimal", highspy.HighsModelStatus.kModelEmpty: "optimal",
    highspy.HighsModelStatus.kObjectiveBound: "cutoff", highspy.HighsModelStatus.kInfeasible: "infeasible",
    highspy.HighsModelStatus.kIterationLimit: "iterations", highspy.HighsModelStatus.kTimeLimit: "time_limit",
}
INTEGRALITY = 1e-9
"""How far from an integer a column may be, and a row from its bounds: legs last 20 s, and fuel must hold to 1e-6 s."""


class Relaxation:
    """The linear relaxation of a model, open for more rows and columns."""

    def __init__(self, model: LinearModel) -> None:
        self._solver = _open(model)
        self._entries = len(model.rows.value)

    def add(self, rows: Rows) -> None:
        """Add rows; the next solve starts from the last basis."""
        self._entries += len(rows.value)
        _check(self._solver.addRows(len(rows.lower), rows.lower, rows.upper, len(rows.value), rows.start[:-1],
                                    rows.column, rows.value), "addRows")

    def set_row_bounds(self, lower: FloatArray, upper: FloatArray) -> None:
        """Change the bounds of all rows."""
        count = len(lower)
        _check(self._solver.changeRowsBounds(count, np.arange(count, dtype=np.int32), lower, upper), "changeRowsBounds")

    def add_columns(self, objective: FloatArray, start: IntArray, row: IntArray, value: FloatArray) -> None:
        """Add columns from 0 up without upper bound; the next solve starts from the last basis."""
        count = len(objective)
        self._entries += len(value)
        _check(self._solver.addCols(count, objective, np.zeros(count), np.full(count, math.inf), len(value),
                                    start[:-1], row, value), "addCols")

    def solve(self, time_limit_s: float) -> Relaxed:
        """The optimum over the rows and columns so far.

        Raises:
            KeyboardInterrupt: If Ctrl-C is pressed during a large program.
        """
        _limit(self._solver, time_limit_s)
        if self._entries < _LARGE:
            _check(self._solver.run(), "run")
        else:
            with deferring_ctrl_c():
                interrupted = _run_interruptibly(self._solver)
            if interrupted:
                raise KeyboardInterrupt
        status = _status(self._solver)
        nothing = np.zeros(0)
        if status != "optimal":
            return Relaxed(status=status, values=None, objective=-math.inf if status == "infeasible" else math.inf,
                           reduced=nothing, activity=nothing, duals=nothing)
        solution = self._solver.getSolution()
        return Relaxed(
            status=status, values=np.array(solution.col_value),
            objective=float(self._solver.getInfo().objective_function_value), reduced=np.array(solution.col_dual),
            activity=np.array(solution.row_value), duals=np.array(solution.row_dual))


    def solve_integer(self, columns: IntArray, time_limit_s: float) -> MipResult:
        """The optimum with some columns integer, proved but for rounding; the relaxation can't be solved again.

        Args:
            columns: Numbers of the integer columns.
            time_limit_s: Wall-clock limit [s]; ``inf`` = none.
        """
        _set_integer(self._solver, columns)
        return _branch_and_bound(self._solver, gap=0.0, absolute_gap=1e-6, time_limit_s=time_limit_s, most_nodes=None,
                                 heuristics=0.05, has_integers=len(columns) > 0)


@dataclass(frozen=True, eq=False, kw_only=True)
class Basis:
    """A basis of a ``Simplex``: what HiGHS holds, for as many rows as there were.

    Attributes:
        raw: HiGHS's basis.
    """

    raw: Any

    def columns(self) -> IntArray:
        """Status of each column, as HiGHS numbers it, shape (columns,)."""
        return np.array([int(status) for status in self.raw.col_status], dtype=np.int64)

    def rows(self) -> IntArray:
        """Status of each row, shape (rows,)."""
        return np.array([int(status) for status in self.raw.row_status], dtype=np.int64)

    def row_count(self) -> int:
        """Number of rows."""
        return len(self.raw.row_status)

    @classmethod
    def of(cls, columns: IntArray, rows: IntArray) -> Basis:
        """A basis from the status of each column and row; it need not be one, HiGHS repairs it."""
        raw = highspy.HighsBasis()
        raw.col_status = [_STATUSES[k] for k in columns.tolist()]
        raw.row_status = [_STATUSES[k] for k in rows.tolist()]
        raw.valid = raw.alien = True
        return cls(raw=raw)


_STATUSES = {int(status): status for status in highspy.HighsBasisStatus.__members__.values()}
AT_LOWER, BASIC = int(highspy.HighsBasisStatus.kLower), int(highspy.HighsBasisStatus.kBasic)


class Simplex:
    """A linear program that is solved over and over by the dual simplex method, from bases of the caller's choice.

    It maximises; HiGHS minimises the negative, as its bound on the objective works for minima alone.
    """

    def __init__(self, model: LinearModel) -> None:
        self._solver = _open(replace(model, objective=-model.objective), maximises=False)
        _option(self._solver, "presolve", "off")
        self._entries = len(model.rows.value)

    def add_rows(self, rows: Rows) -> None:
        """Add rows; they are basic."""
        self._entries += len(rows.value)
        _check(self._solver.addRows(len(rows.lower), rows.lower, rows.upper, len(rows.value), rows.start[:-1],
                                    rows.column, rows.value), "addRows")

    def add_columns(self, objective: FloatArray, upper: FloatArray, start: IntArray, row: IntArray, value: FloatArray,
                    ) -> None:
        """Add columns from 0 up; they are at 0."""
        self._entries += len(value)
        _check(self._solver.addCols(len(objective), -objective, np.zeros(len(objective)), upper, len(value), start[:-1],
                                    row, value), "addCols")

    def set_bounds(self, columns: IntArray, lower: FloatArray, upper: FloatArray) -> None:
        """Change the bounds of columns."""
        _check(self._solver.changeColsBounds(len(columns), columns.astype(np.int32), lower, upper), "changeColsBounds")

    def basis(self) -> Basis:
        """The basis of the last solve."""
        return Basis(raw=self._solver.getBasis())

    def set_basis(self, basis: Basis) -> None:
        """Start the next solve from a basis."""
        _check(self._solver.setBasis(basis.raw), "setBasis")

    def forget(self) -> None:
        """Start the next solve from nothing."""
        _check(self._solver.clearSolver(), "clearSolver")

    def solve(self, time_limit_s: float, *, cutoff: float = -math.inf, iterations: int | None = None) -> EndOfSimplex:
        """Solve from the basis; how it ended.

        Args:
            time_limit_s: Wall-clock limit [s]; ``inf`` = none.
            cutoff: Objective below which the optimum is of no interest.
            iterations: Iterations after which it stops; ``None`` = none.

        Raises:
            KeyboardInterrupt: If Ctrl-C is pressed, where it is heard.
        """
        deadline = time.monotonic() + time_limit_s
        _option(self._solver, "objective_bound", -cutoff)
        # Runs of a bounded number of iterations, after each of which Python hears of Ctrl-C.
        at_a_time = max(_FEWEST_ITERATIONS, min(_MOST_ITERATIONS, _WORK // max(self._entries, 1)))
        failed = False
        while True:
            left = at_a_time if iterations is None else min(iterations, at_a_time)
            _option(self._solver, "simplex_iteration_limit", left)
            _limit(self._solver, max(deadline - time.monotonic(), 0.0))
            self._solver.run()
            ended = _ENDS.get(self._solver.getModelStatus())
            if ended == "iterations":
                iterations = None if iterations is None else iterations - left
                if iterations is None or iterations > 0:
                    continue
            if ended is not None:
                return ended
            if failed:
                raise RuntimeError("HiGHS: unexpected model status "
                                   f"{self._solver.modelStatusToString(self._solver.getModelStatus())}")
            self.forget()  # it gave up, which is rare: from nothing it finds its way
            failed = True

    def objective(self) -> float:
        """Objective at the end of the last solve: that of a relaxation where it stopped early."""
        return -float(self._solver.getInfo().objective_function_value)

    def values(self) -> FloatArray:
        """Value of each column, shape (columns,)."""
        return np.array(self._solver.getSolution().col_value)

    def duals(self) -> FloatArray:
        """Dual value of each row: gain in the objective per unit of its bound, shape (rows,)."""
        return -np.array(self._solver.getSolution().row_dual)

    def ray(self) -> FloatArray | None:
        """Multipliers of the rows that prove an infeasible program infeasible, shape (rows,); ``None`` if there are
        none at hand."""
        _, there, values = self._solver.getDualRay()
        return -np.array(values) if there else None


def maximise(
    model: LinearModel, rows: Rows, *, gap: float, absolute_gap: float, time_limit_s: float,
    start: FloatArray | None = None, most_nodes: int | None = None, heuristics: float = 0.0,
) -> MipResult:
    """Solve a mixed-integer program by branch and bound; Ctrl-C ends it with what it has.

    Args:
        model: The program.
        rows: More rows of it.
        gap: Relative gap at which it may stop.
        absolute_gap: Absolute gap at which it may stop.
        time_limit_s: Wall-clock limit [s]; ``inf`` = none.
        start: A feasible point to begin with, shape (columns,).
        most_nodes: Branch-and-bound nodes after which it stops; ``None`` = no limit.
        heuristics: Share of its time that HiGHS may spend on finding better points.
    """
    solver = _open(model)
    if len(rows.lower):
        _check(solver.addRows(len(rows.lower), rows.lower, rows.upper, len(rows.value), rows.start[:-1], rows.column,
                              rows.value), "addRows")
    _set_integer(solver, np.flatnonzero(model.integer))
    for presolve in ("choose", "off"):
        _option(solver, "presolve", presolve)
        if start is not None:
            solution = highspy.HighsSolution()
            solution.col_value = start.tolist()
            _check(solver.setSolution(solution), "setSolution")
        outcome = _branch_and_bound(solver, gap=gap, absolute_gap=absolute_gap, time_limit_s=time_limit_s,
                                    most_nodes=most_nodes, heuristics=heuristics,
                                    has_integers=bool(model.integer.any()))
        # At tolerances as tight as ours, HiGHS's presolve now and then finds a feasible program infeasible; with a
        # point to begin with it then reports that one as optimal, without a bound.
        if outcome.status != "infeasible" and not (outcome.status == "optimal" and math.isinf(outcome.bound)):
            break
    return outcome


def _set_integer(solver: Any, columns: IntArray) -> None:
    kinds = np.full(len(columns), int(highspy.HighsVarType.kInteger), dtype=np.uint8)
    _check(solver.changeColsIntegrality(len(columns), columns.astype(np.int32), kinds), "changeColsIntegrality")


def _branch_and_bound(
    solver: Any, *, gap: float, absolute_gap: float, time_limit_s: float, most_nodes: int | None, heuristics: float,
    has_integers: bool,
) -> MipResult:
    _option(solver, "mip_rel_gap", gap)
    _option(solver, "mip_abs_gap", absolute_gap)
    _option(solver, "mip_feasibility_tolerance", INTEGRALITY)
    _option(solver, "mip_allow_restart", False)  # restarts cost up to five times the time here
    _option(solver, "mip_heuristic_effort", heuristics)
    _option(solver, "time_limit", time_limit_s)
    if most_nodes is not None:
        _option(solver, "mip_max_nodes", most_nodes)
    with deferring_ctrl_c():
        interrupted = _run_interruptibly(solver)
    status: SolveStatus = "interrupted" if interrupted else _status(solver)
    info = solver.getInfo()
    found = info.primal_solution_status == highspy.SolutionStatus.kSolutionStatusFeasible
    # Without integer columns, as where no route is left to choose, HiGHS solves a linear program and states no bound.
    bound = float(info.mip_dual_bound if has_integers else info.objective_function_value)
    if not math.isfinite(bound) or status == "infeasible":
        bound = -math.inf if status == "infeasible" else math.inf
    return MipResult(
        status=status, values=np.array(solver.getSolution().col_value) if found else None,
        objective=float(info.objective_function_value) if found else -math.inf, bound=bound,
        nodes=max(int(info.mip_node_count), 0),
    )


class _Silent(highspy.Highs):  # type: ignore[misc]
    """HiGHS without a banner on standard output.

    The banner is printed at the first call that sets no option; from 1.16 on that is this one, in the constructor.
    """

    def enableCallbacks(self) -> None:
        """Turn output off, and callbacks on."""
        _option(self, "output_flag", False)
        super().enableCallbacks()


def _open(model: LinearModel, *, maximises: bool = True) -> Any:
    """A solver that holds the model's linear relaxation."""
    solver = _Silent()
    # From 1.16 on HiGHS branches on several threads by default, and ties would depend on the machine.
    _option(solver, "threads", 1)
    _option(solver, "parallel", "off")
    _option(solver, "random_seed", 0)
    _option(solver, "primal_feasibility_tolerance", INTEGRALITY)
    if not model.aggregates:
        _option(solver, "presolve_rule_off", _AGGREGATOR)
    columns, rows = len(model.objective), model.rows
    program = highspy.HighsLp()
    program.num_col_, program.num_row_ = columns, len(rows.lower)
    program.sense_ = highspy.ObjSense.kMaximize if maximises else highspy.ObjSense.kMinimize
    program.col_cost_ = model.objective
    program.col_lower_, program.col_upper_ = np.zeros(columns), model.upper
    program.row_lower_, program.row_upper_ = rows.lower, rows.upper
    matrix = program.a_matrix_
    matrix.format_ = highspy.MatrixFormat.kRowwise
    matrix.num_col_, matrix.num_row_ = columns, len(rows.lower)
    matrix.start_, matrix.index_, matrix.value_ = rows.start, rows.column, rows.value
    _check(solver.passModel(program), "passModel")
    return solver


def _run_interruptibly(solver: Any) -> bool:
    """Run the solver in a thread, so that Ctrl-C cancels it at once; whether it did.

    Ctrl-C is then handled: the caller still uses what the solver has found.
    """
    solver.HandleUserInterrupt = True
    ended: list[Any] = []
    over = Event()  # not Thread.join: interrupted, it marks a running thread as stopped (Python 3.11)

    def run() -> None:
        try:
            ended.append(solver.run())
        finally:
            over.set()

    thread = Thread(target=run, daemon=True)
    thread.start()
    interrupted = False
    while not over.wait(_POLL_S):
        if pressed():
            heard_ctrl_c()
            interrupted = True
            solver.cancelSolve()
    thread.join()
    if not ended:
        raise RuntimeError("HiGHS: the solve ended without a status")
    _check(ended[0], "run")
    return interrupted


def _status(solver: Any) -> SolveStatus:
    status = solver.getModelStatus()
    kinds = highspy.HighsModelStatus
    if status in (kinds.kOptimal, kinds.kModelEmpty):
        return "optimal"
    if status == kinds.kInfeasible:
        return "infeasible"
    if status in (kinds.kTimeLimit, kinds.kSolutionLimit):  # the latter stands for a limit on nodes too
        return "time_limit"
    if status == kinds.kInterrupt:
        return "interrupted"
    raise RuntimeError(f"HiGHS: unexpected model status {solver.modelStatusToString(status)}")


def _limit(solver: Any, time_limit_s: float) -> None:
    """Limit the time of the next run of a linear program, which HiGHS adds to that of the runs before."""
    _option(solver, "time_limit", solver.getRunTime() + time_limit_s)


def _option(solver: Any, name: str, value: bool | int | float | str) -> None:
    _check(solver.setOptionValue(name, value), f"option {name}")


def _check(status: Any, what: str) -> None:
    """Raise on an error; warnings show in the model status."""
    if status == highspy.HighsStatus.kError:
        raise RuntimeError(f"HiGHS: {what} failed")
