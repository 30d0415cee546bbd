"""What commands print: results on standard output, progress and messages on standard error."""

from __future__ import annotations

import json
import logging
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.logging import RichHandler
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from sva_bench.errors import BadInput

messages = Console(stderr=True)


def results() -> Console:
    """Standard output; tables keep their shape in a pipe."""
    return Console(width=None if sys.stdout.isatty() else 140)


def print_json(data: Any) -> None:
    """Print a result as JSON on standard output."""
    sys.stdout.write(json.dumps(data, indent=1, allow_nan=False) + "\n")


def check_output(path: Path | None, *sources: Path) -> None:
    """Refuse a place for a result where nothing can be written, or one that would write over what it is made of.

    Raises:
        BadInput: If the folder isn't there, or the file is one of the sources.
    """
    if path is None:
        return
    if not path.resolve().parent.is_dir():
        raise BadInput(f"{path}: there is no such folder; choose another place with -o")
    if any(source.exists() and path.exists() and path.samefile(source) for source in sources):
        raise BadInput(f"{path}: this is what is read, and would be lost; choose another name with -o")


def write_result(path: Path | None, content: str | bytes) -> None:
    """Write a result to a file, whole or not at all, or to standard output; pipes and devices are written through."""
    data = content.encode("utf-8") if isinstance(content, str) else content
    if path is None:
        if isinstance(content, str):
            sys.stdout.write(content)
        else:
            sys.stdout.buffer.write(content)
        return
    target = path.resolve()  # a link stays one
    draft = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    try:
        if target.exists() and not target.is_file():
            path.write_bytes(data)
        else:
            draft.write_bytes(data)
            draft.replace(target)
    except OSError as error:
        draft.unlink(missing_ok=True)
        raise BadInput(f"{path}: cannot be written ({error.strerror}); choose another place with -o") from None


def write_beside(path: Path, name: str, content: bytes) -> None:
    """Write a file that belongs to another, by its name relative to the other's folder."""
    target = path.parent / name
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"{target.parent}: cannot be made ({error.strerror}); choose another place with -o") from None
    write_result(target, content)


def set_up_logging(verbose: bool) -> None:
    """Send warnings to standard error, and everything of ours where the user wants to know more."""
    if messages.is_terminal:
        logging.basicConfig(level=logging.WARNING, format="%(message)s", force=True,
                            handlers=[RichHandler(console=messages, show_time=False, show_path=False)])
    else:  # a line each, whatever reads them
        logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(message)s", force=True)
    logging.getLogger("sva_bench").setLevel(logging.DEBUG if verbose else logging.WARNING)


@contextmanager
def progress_bars() -> Iterator[Callable[[str, int, int], None]]:
    """Progress bars on standard error; plain lines where that is no terminal."""
    if not messages.is_terminal:
        said: set[str] = set()

        def say(what: str, done: int, of: int) -> None:
            if what not in said and done < of:
                said.add(what)
                messages.print(f"{what} ...", highlight=False)

        yield say
        return
    with Progress(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
                  console=messages, transient=True) as bars:
        tasks: dict[str, Any] = {}

        def show(what: str, done: int, of: int) -> None:
            if what not in tasks:
                tasks[what] = bars.add_task(what, total=of)
            bars.update(tasks[what], completed=done, total=of)

        yield show


def print_summary(summary: Any) -> None:
    """Print a summary as a table, and what it comes to."""
    from sva_bench.analysis.reach import infeasible, lost_robots
    from sva_bench.analysis.wording import (
        ASSUMPTION_HEAD,
        answer,
        assumption_rows,
        ranked,
        remarks,
        vss_verdict,
        with_interval,
    )

    console = results()
    scenarios, travel = summary["scenarios"], summary["travel"]
    table = Table(title=f"{summary['world']}, seed {summary['seed']}: {summary['trials']} trials, "
                        f"{summary['rollouts']} rollouts, {summary['fidelity']}", title_justify="left")
    compared = "vss" in scenarios[0]
    judged = any("lost" in plan for plan in scenarios[0]["plans"].values())  # plans from anywhere may lose robots
    for heading in ("scenario", "plan", *(("robots lost",) if judged else ()), "promised", "expected",
                    "executed [95 %]", *scenarios[0]["availability"],
                    *(("VSS executed [95 %]", "VSS modelled", "EVPI") if compared else ())):
        table.add_column(heading, justify="left" if heading in ("scenario", "plan") else "right")
    for scenario in scenarios:
        last = list(scenario["plans"])[-1]
        for number, (name, plan) in enumerate(scenario["plans"].items()):
            proof = "" if plan["status"] in ("optimal", None) else f" ({plan['status']})"
            proof = " (infeasible)" if infeasible(plan) else proof
            worth = ["", "", ""] if compared else []
            if compared and number == 0:
                vss, evpi = scenario["vss"], scenario["evpi"]
                worth = [vss_verdict(scenario), f"{vss['modelled']:.1f}", "" if evpi is None else f"{evpi:.1f}"]
            table.add_row(
                "" if number else scenario["name"], name + proof, *((lost_robots(plan),) if judged else ()),
                f"{plan['promised']:.1f}", f"{plan['expected']:.1f}",
                with_interval(plan["executed"]), *(f"{x:.1f}" for x in plan["by_robot"].values()), *worth,
                end_section=name == last)
    console.print(table)
    missions, unhappy = 0, []
    for name in scenarios[0]["plans"]:
        ends: dict[str, int] = {}
        for scenario in scenarios:
            for end, count in scenario["plans"][name]["ends"].items():
                ends[end] = ends.get(end, 0) + count
        missions += sum(ends.values())
        bad = [f"{ends[end]} {end}" for end in ("out_of_fuel", "late", "stuck") if end in ends]
        if bad:
            unhappy.append(f"{', '.join(bad)} ({name})")
    console.print(f"{travel['pairs']} travel times, {travel['triangle_violations_pct']:.1f} % repaired, by up to "
                  f"{travel['max_excess_pct']:.1f} %; planned under {summary['failure']['plan']}, executed under "
                  f"{summary['failure']['execute']} failures.", highlight=False)
    if unhappy:
        console.print(f"Of {missions} robot missions ended otherwise than home or by draw: {'; '.join(unhappy)}.",
                      highlight=False)
    for scenario in scenarios:
        if scenario.get("comparisons"):
            console.print(f"{scenario['name']}: {ranked(scenario)}", highlight=False, markup=False)
    console.print(answer(summary), highlight=False)
    for said in remarks(summary):
        console.print(said, highlight=False)
    if rows := assumption_rows(scenarios):
        crossed = Table(title="Plans under the failures they were made for and under the others", title_justify="left")
        for number, heading in enumerate(ASSUMPTION_HEAD):
            crossed.add_column(heading, justify="left" if number < 4 else "right")
        for row in rows:
            crossed.add_row(*row)
        console.print(crossed)
    if not summary["reproducible"]:
        console.print("A solve met its limit: these plans may differ on another machine.", highlight=False)
