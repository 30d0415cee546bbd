"""Runs the solves of the paper's section 5.1 again, and sets ours beside its Tables 2 and 3 and its Figure 3.

Run: ``python -m benchmarks.solver.paper [--quick] [--time-limit S] [--tau T] [-o DIR]``. The whole grid takes a day and
more; a row is kept as each solve ends, and a second start goes on. Ctrl-C leaves a report of what is done.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from benchmarks.solver.grid import FULL, Row, Study, read_rows, run
from benchmarks.solver.picture import draw_gaps
from benchmarks.solver.report import markdown
from sva_bench.errors import BadInput, ExitCode, SvaBenchError

NAME = "paper-runtimes"
QUICK = replace(FULL, pois=(10, 20, 40, 60), seeds=(0,), availabilities=(0.75,), time_limit_s=10.0)
"""Under ten minutes on an idle core: four sizes, one seed, one availability, all fuel capacities and methods."""


def reproduce(study: Study, folder: Path) -> str:
    """Solve what is not solved yet, and write rows, report and picture into a folder; the report.

    Files: ``paper-runtimes.csv`` (the rows), ``paper-runtimes.md``, ``paper-runtimes.png``.

    Raises:
        SvaBenchError: If the folder holds something else, or can't be written to.
        KeyboardInterrupt: After Ctrl-C; the report of what is done is written all the same.
    """
    path = folder / f"{NAME}.csv"
    try:
        rows = run(study, path, _tell)
    except KeyboardInterrupt:
        cases = set(study.cases())
        write_report([row for row in read_rows(path) if row.case in cases], study, folder)
        raise
    return write_report(rows, study, folder)


def write_report(rows: Sequence[Row], study: Study, folder: Path) -> str:
    """Write report and picture of some rows into a folder; the report."""
    if not rows:
        return markdown(rows, study)
    text = markdown(rows, study, f"{NAME}.png")
    try:
        draw_gaps(rows, folder / f"{NAME}.png")
        (folder / f"{NAME}.md").write_text(text, encoding="utf-8")
    except OSError as error:
        raise BadInput(f"{folder}: cannot be written ({error.strerror}); choose another folder with -o") from None
    return text


def _tell(done: int, of: int, row: Row) -> None:
    print(f"{done}/{of}  {row.pois} POIs, seed {row.seed}, F {row.fuel_multiple:g}, availability {row.availability:g}, "
          f"{row.method}: {row.status}, gap {row.gap_pct:.2f} %, {row.process_s:.2f} s", file=sys.stderr, flush=True)


def main(arguments: Sequence[str] | None = None) -> ExitCode:
    """Run what the command line asks for, and print the report."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.solver.paper", description=__doc__)
    parser.add_argument("--quick", action="store_true",
                        help="four sizes, one seed, one availability: under ten minutes")
    parser.add_argument("--time-limit", type=float, metavar="S",
                        help=f"wall-clock limit of each solve [s]; default {FULL.time_limit_s:g}, with --quick "
                             f"{QUICK.time_limit_s:g}")
    parser.add_argument("--tau", type=float, default=FULL.tau, metavar="T",
                        help="mission limit in fuel capacities, which the paper leaves open; default %(default)g")
    parser.add_argument("-o", "--out", type=Path, metavar="DIR", help=f"default runs/{NAME}, with --quick -quick")
    options = parser.parse_args(arguments)
    study = QUICK if options.quick else FULL
    folder = options.out or Path("runs") / (f"{NAME}-quick" if options.quick else NAME)
    try:
        study = replace(study, tau=options.tau, time_limit_s=study.time_limit_s if options.time_limit is None
                        else options.time_limit)
        print(reproduce(study, folder), end="")
    except SvaBenchError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print(f"interrupted: {folder} keeps what is done, and the same command goes on", file=sys.stderr)
        return ExitCode.INTERRUPTED
    return ExitCode.DONE


if __name__ == "__main__":
    sys.exit(main())
