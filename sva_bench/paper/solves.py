"""The solves of the paper's section 5.1, a row each; a run that was stopped goes on where it was.

The paper's two vehicles are those of ``random_instance``: the first is certain and earns U(0, 150) at half of the POIs,
the second earns U(0, 170) at all of them and is available in 100, 75, 25 and 0 % of the missions.
"""

from __future__ import annotations

import csv
import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import get_args

from sva_bench.choices import Method, Status
from sva_bench.errors import BadFile, BadInput
from sva_bench.files.printable import counted
from sva_bench.generate.instances import random_instance
from sva_bench.mission.instance import Instance
from sva_bench.mission.plan import Plan
from sva_bench.solver.two_stage import SolveLimits, plan_stochastic

VEHICLES = 2
METHODS: tuple[Method, ...] = ("dep", "relaxed", "lshaped", "expected", "auto")
"""The paper's three, then what its model collapses to, then what ``sva-bench plan`` takes unasked."""


_NOTHING = 1e-10  # CPLEX's guard against plans that are worth nothing


@dataclass(frozen=True, kw_only=True)
class Case:
    """What one solve is of.

    Attributes:
        pois: Number of POIs.
        seed: Seed of places and incentives.
        fuel_multiple: Fuel capacity in largest distances.
        availability: Availability of the second vehicle.
        method: Method of the solve.
    """

    pois: int
    seed: int
    fuel_multiple: float
    availability: float
    method: Method

    def instance(self, tau: float) -> Instance:
        """The instance, with a mission limit of ``tau`` fuel capacities."""
        return random_instance("A", pois=self.pois, vehicles=VEHICLES, availability=self.availability, seed=self.seed,
                               fuel_multiple=self.fuel_multiple, tau=tau)


@dataclass(frozen=True, kw_only=True)
class Study:
    """Which cases are solved, and how.

    Attributes:
        pois: Numbers of POIs.
        seeds: Seeds.
        fuel_multiples: Fuel capacities in largest distances.
        availabilities: Availabilities of the second vehicle.
        methods: Methods.
        tau: Mission limit in fuel capacities.
        time_limit_s: Wall-clock limit of each solve [s].
    """

    pois: tuple[int, ...] = (10, 20, 30, 40, 50, 60)
    seeds: tuple[int, ...] = (0, 1, 2, 3, 4)
    fuel_multiples: tuple[float, ...] = (2.25, 2.5, 2.75, 3.0)
    availabilities: tuple[float, ...] = (1.0, 0.75, 0.25, 0.0)
    methods: tuple[Method, ...] = METHODS
    tau: float = 1.0
    time_limit_s: float = 60.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.tau) and self.tau > 0 and math.isfinite(self.time_limit_s)
                and self.time_limit_s > 0):
            raise BadInput(f"a time limit of {self.time_limit_s:g} s and a mission limit of {self.tau:g} fuel "
                           "capacities: both must be finite and above 0")

    def cases(self) -> Iterator[Case]:
        """All cases, a seed after the other, so that a run that is stopped has some of every kind."""
        for seed in self.seeds:
            for pois in self.pois:
                for fuel in self.fuel_multiples:
                    for availability in self.availabilities:
                        for method in self.methods:
                            yield Case(pois=pois, seed=seed, fuel_multiple=fuel, availability=availability,
                                       method=method)


FULL = Study()
"""The paper's grid: 480 instances and availabilities by five methods."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """What one solve came to.

    Attributes:
        pois, seed, fuel_multiple, availability, method: The case.
        tau: Mission limit in fuel capacities.
        time_limit_s: Wall-clock limit [s].
        status: How it ended.
        value: Value of the plan.
        bound: Upper bound on it.
        process_s: Processor time [s]; solves run in one thread.
        wall_s: Wall-clock time [s].
        optimality_cuts: Optimality cuts, of ``lshaped``.
        subtour_cuts: Subtour cuts in the last program.
        nodes: Branch-and-bound nodes.
        proved_by: The method that ``auto`` chose; else the method.
        processor: What it ran on.
    """

    pois: int
    seed: int
    fuel_multiple: float
    availability: float
    method: Method
    tau: float
    time_limit_s: float
    status: Status
    value: float
    bound: float
    process_s: float
    wall_s: float
    optimality_cuts: int
    subtour_cuts: int
    nodes: int
    proved_by: str
    processor: str

    @property
    def case(self) -> Case:
        """What it is a row of."""
        return Case(pois=self.pois, seed=self.seed, fuel_multiple=self.fuel_multiple, availability=self.availability,
                    method=self.method)

    @property
    def gap_pct(self) -> float:
        """What is left between plan and bound, in per cent of the plan, as CPLEX has it."""
        if self.status == "optimal" or self.bound <= self.value:
            return 0.0
        return 100 * (self.bound - self.value) / (_NOTHING + abs(self.value))


def measure(case: Case, study: Study) -> Row:
    """Solve a case.

    Raises:
        KeyboardInterrupt: If Ctrl-C ended the solve: its row would not be like the others.
    """
    instance = case.instance(study.tau)
    began, began_wall = time.process_time(), time.perf_counter()
    plan = plan_stochastic(instance, SolveLimits(time_limit_s=study.time_limit_s), method=case.method)
    process_s, wall_s = time.process_time() - began, time.perf_counter() - began_wall
    if plan.status == "interrupted":
        raise KeyboardInterrupt
    return row_of(case, study, plan, process_s=process_s, wall_s=wall_s)


def row_of(case: Case, study: Study, plan: Plan, *, process_s: float, wall_s: float) -> Row:
    """The row of a plan."""
    if plan.value is None or plan.bound is None or plan.status is None:
        raise ValueError("a plan of ours has a value, a bound and a status")
    return Row(
        **asdict(case), tau=study.tau, time_limit_s=study.time_limit_s, status=plan.status, value=plan.value,
        bound=plan.bound, process_s=round(process_s, 3), wall_s=round(wall_s, 3),
        optimality_cuts=int(plan.details.get("optimality_cuts", 0)), subtour_cuts=int(plan.details.get("cuts", 0)),
        nodes=int(plan.details.get("nodes", 0)), proved_by=plan.method or case.method, processor=processor())


def warm_up(study: Study) -> None:
    """Load what is compiled, and let each method meet its libraries, before anything is timed.

    The own method goes by size and rewards, so it takes several instances to meet all that is compiled.
    """
    for method in study.methods:
        for pois, availability in ((6, 0.75), *(((20, 1.0), (20, 0.0)) if method == "auto" else ())):
            case = Case(pois=pois, seed=0, fuel_multiple=2.25, availability=availability, method=method)
            plan_stochastic(case.instance(study.tau), SolveLimits(time_limit_s=study.time_limit_s), method=method)


def run(study: Study, path: Path, on_row: Callable[[int, int, Row], None] = lambda done, of, row: None) -> list[Row]:  # noqa: ARG005
    """Solve all cases that a file has no rows of yet, and append a row as each ends.

    Args:
        study: What to solve.
        path: The file; it need not exist.
        on_row: Called after each solve with the cases done, all cases, and the new row.

    Returns:
        The rows of the study, in its order.

    Raises:
        BadFile: If the file holds something else.
        BadInput: If its rows were made with another limit.
    """
    known = {row.case: row for row in read_rows(path)}
    for row in known.values():
        if (row.tau, row.time_limit_s) != (study.tau, study.time_limit_s):
            raise BadInput(f"{path}: its rows were made with a time limit of {row.time_limit_s:g} s and a mission "
                           f"limit of {row.tau:g} fuel capacities, not {study.time_limit_s:g} s and {study.tau:g}: "
                           f"pass --time-limit {row.time_limit_s:g} --tau {row.tau:g} to go on, or another --out")
    cases = list(study.cases())
    left = [case for case in cases if case not in known]
    if left:
        _make_ready(path)
        warm_up(study)
    for case in left:
        row = measure(case, study)
        append(path, row)
        known[case] = row
        on_row(sum(case in known for case in cases), len(cases), row)
    return [known[case] for case in cases]


def append(path: Path, row: Row) -> None:
    """Append a row."""
    with _writing(path), path.open("a", encoding="utf-8", newline="") as file:
        csv.DictWriter(file, NAMES, lineterminator="\n").writerow(asdict(row))


def _make_ready(path: Path) -> None:
    """A file that rows can be appended to: with a header, and without a line that was being written at the end."""
    kept = _whole_lines(path) or ",".join(NAMES) + "\n"
    with _writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        draft = path.with_suffix(".tmp")
        draft.write_text(kept, encoding="utf-8")
        draft.replace(path)


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    """Say plainly when a file can't be written."""
    try:
        yield
    except OSError as error:
        raise BadInput(f"{path}: cannot be written ({error.strerror}); choose another folder with --out") from None


def _whole_lines(path: Path) -> str:
    """The text of a file up to its last line end; empty if there is no file."""
    try:
        text = path.read_bytes().decode("utf-8")
    except FileNotFoundError:
        return ""
    except OSError as error:
        raise BadInput(f"{path}: cannot be read ({error.strerror}); choose another folder with --out") from None
    except UnicodeDecodeError:
        raise BadFile(path, None, "", "this is no text; remove the file, or choose another folder with --out") from None
    return text[:text.rfind("\n") + 1]


def read_rows(path: Path) -> list[Row]:
    """The rows of a file, but for a last line that was never finished; none if there is no file.

    Raises:
        BadFile: If it holds something else.
    """
    lines = csv.reader(_whole_lines(path).splitlines())
    header = next(lines, None)
    if header is None:
        return []
    if header != list(NAMES):
        raise BadFile(path, 1, "", "these are not the columns of this benchmark's rows; remove the file, or choose "
                                   "another folder with --out")
    rows = []
    for number, cells in enumerate(lines, start=2):
        if len(cells) != len(NAMES):
            raise BadFile(path, number, "", f"{counted(len(cells), 'cell')} in place of {len(NAMES)}; remove the line")
        rows.append(_row(path, number, dict(zip(NAMES, cells, strict=True))))
    return rows


def _row(path: Path, line: int, cells: Mapping[str, str]) -> Row:
    values: dict[str, object] = {}
    for name, text in cells.items():
        try:
            values[name] = _READ.get(name, str)(text)
        except ValueError:
            raise BadFile(path, line, name, f"{text!r} is no such value; remove the line") from None
    return Row(**values)  # type: ignore[arg-type]  # each was read by its column's type


def _one_of(words: tuple[str, ...]) -> Callable[[str], str]:
    def read(text: str) -> str:
        if text not in words:
            raise ValueError(text)
        return text
    return read


def _number(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return value


NAMES = tuple(field.name for field in fields(Row))
"""Columns of the file."""
_READ: dict[str, Callable[[str], object]] = {
    **dict.fromkeys(("pois", "seed", "optimality_cuts", "subtour_cuts", "nodes"), int),
    **dict.fromkeys(("fuel_multiple", "availability", "tau", "time_limit_s", "value", "bound", "process_s", "wall_s"),
                    _number),
    "method": _one_of(get_args(Method)), "status": _one_of(get_args(Status)),
}


def processor() -> str:
    """What this machine's processor calls itself."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else "unnamed"
