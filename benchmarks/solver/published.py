"""Published instances solved one by one: what their runners share.

Rows are appended to a table as they are found, and rows that are there are skipped, so that a run can be continued.
The published best values are read from ``best.csv`` in the folder of the data, if it is there: a header
``instance,best`` and a row for each instance, named as its file without the ending. ``optima.json`` serves too: an
object of instances, of which each has a ``best``.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from sva_bench.generate.instances import random_instance
from sva_bench.mission.instance import Instance
from sva_bench.solver.two_stage import SolveLimits, plan_stochastic

COLUMNS = ("instance", "pois", "vehicles", "cpu_s", "proved", "value", "bound", "best", "off_pct", "note")
"""Processor time in seconds; ``off_pct``: how far the value stays behind the best, in per cent; ``note``: why an
instance was skipped."""


class NotServed(Exception):
    """An instance that the model has no place for, or a file that isn't one; says why."""


def best_values(folder: Path) -> dict[str, float]:
    """The published best values by instance; none without a file of them.

    Raises:
        ValueError: If the file has other columns, or a value that is no number.
    """
    table, optima = folder / "best.csv", folder / "optima.json"
    if table.is_file():
        with table.open(encoding="utf-8", newline="") as file:
            rows = csv.DictReader(file)
            if not {"instance", "best"} <= set(rows.fieldnames or ()):
                raise ValueError(f"{table}: expected the columns instance and best, found {rows.fieldnames}")
            return {row["instance"]: float(row["best"]) for row in rows}
    if optima.is_file():
        return {name: float(entry["best"]) for name, entry in json.loads(optima.read_text(encoding="utf-8")).items()}
    return {}


def row_of(name: str, instance: Instance, best: float | None, time_limit_s: float | None) -> dict[str, str]:
    """The row of one instance, solved."""
    began = time.process_time()
    plan = plan_stochastic(instance, SolveLimits(time_limit_s=time_limit_s))
    seconds = time.process_time() - began
    if plan.status == "interrupted":
        raise KeyboardInterrupt
    value, bound = plan.value or 0.0, plan.bound or 0.0
    return {
        "instance": name, "pois": str(len(instance.pois)), "vehicles": str(len(instance.vehicles)),
        "cpu_s": f"{seconds:.2f}", "proved": "yes" if plan.status == "optimal" else "no", "value": f"{value:.9g}",
        "bound": f"{bound:.9g}", "best": "" if best is None else f"{best:.9g}",
        "off_pct": "" if not best else f"{100 * (best - value) / best:.3f}", "note": ""}


def run(
    files: Sequence[Path], read: Callable[[Path], Instance], best: dict[str, float], out: Path | None,
    time_limit_s: float | None, limit: int | None,
) -> list[dict[str, str]]:
    """Solve instances, print their rows, and append them to a table; the rows of this run and of those before.

    Args:
        files: A file for each instance.
        read: Reads one; raises ``NotServed`` where the model has no place for it.
        best: Published best values by instance.
        out: The table; ``None`` = none.
        time_limit_s: Wall-clock time for each instance [s]; ``None`` = none.
        limit: Most instances that this run solves; ``None`` = all.
    """
    rows: list[dict[str, str]] = []
    if out is not None and out.is_file():
        with out.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
    done = {row["instance"] for row in rows}
    left = [path for path in files if path.stem not in done][:limit]
    for path in left:
        try:
            row = row_of(path.stem, read(path), best.get(path.stem), time_limit_s)
        except NotServed as reason:
            row = {**dict.fromkeys(COLUMNS, ""), "instance": path.stem, "note": f"skipped: {reason}"}
        rows.append(row)
        print("  ".join(f"{column} {row[column]}" for column in COLUMNS if row[column]), flush=True)
        if out is not None:
            _append(out, row)
    return rows


def _append(out: Path, row: dict[str, str]) -> None:
    is_new = not out.is_file() or out.stat().st_size == 0
    with out.open("a", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        if is_new:
            writer.writeheader()
        writer.writerow(row)


def summary(rows: Sequence[dict[str, str]]) -> str:
    """What a run comes to, in a line."""
    solved = [row for row in rows if not row["note"]]
    reached = sum(1 for row in solved if row["off_pct"] and float(row["off_pct"]) <= 1e-3)
    known = sum(1 for row in solved if row["off_pct"])
    return (f"{len(solved)} instances in {math.fsum(float(row['cpu_s']) for row in solved):.0f} s of processor time: "
            f"{sum(1 for row in solved if row['proved'] == 'yes')} proved, {reached} of {known} with a published best "
            f"reach it; {len(rows) - len(solved)} skipped")


def main(description: str, patterns: Sequence[str], read: Callable[[Path], Instance],
         arguments: Sequence[str] | None = None) -> None:
    """The command line of a runner.

    Args:
        description: The runner's docstring.
        patterns: Names of the files of instances, below the folder.
        read: Reads one.
        arguments: Arguments; ``None`` = those of the process.
    """
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, metavar="DIR", help="folder of the instances")
    parser.add_argument("--out", type=Path, metavar="FILE", help="table (CSV); rows that are there are skipped")
    parser.add_argument("--time-limit", type=float, metavar="S", help="wall-clock time for each instance [s]")
    parser.add_argument("--limit", type=int, metavar="N", help="solve N instances at most")
    args = parser.parse_args(arguments)
    if not args.data.is_dir():
        parser.error(f"--data {args.data}: no such folder")
    files = sorted({path for pattern in patterns for path in args.data.rglob(pattern)})
    if not files:
        parser.error(f"--data {args.data}: no file named {' or '.join(patterns)} in it")
    plan_stochastic(random_instance("A", pois=8, vehicles=2, availability=0.75, seed=0, directed=True))  # compiles
    print(summary(run(files, read, best_values(args.data), args.out, args.time_limit, args.limit)))
