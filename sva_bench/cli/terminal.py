"""What commands print: results on standard output, progress and messages on standard error."""

from __future__ import annotations

import json
import logging
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.logging import RichHandler
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeElapsedColumn
from rich.segment import Segment
from rich.table import Table

from sva_bench.errors import BadInput
from sva_bench.files.printable import counted, printable
from sva_bench.files.streams import CLOSED, output_is_closed
from sva_bench.interrupts import holding_back_ctrl_c
from sva_bench.workers.progress import OnProgress

if TYPE_CHECKING:
    from sva_bench.analysis.summaries import AnySummary, Summary


class SafeConsole(Console):
    """Prints nothing that a terminal would obey, wherever a text came from: the one door for all that is shown."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """What is to be printed, piece by piece."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else Segment(printable(segment.text), segment.style)


class _SafeFormatter(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        return printable(super().format(record))


messages = SafeConsole(stderr=True)


def results() -> Console:
    """Standard output; tables keep their shape in a pipe."""
    return SafeConsole(width=None if sys.stdout.isatty() else 140, markup=False)  # names may hold brackets


def print_json(data: Mapping[str, Any]) -> None:
    """Print a result as JSON on standard output.

    Raises:
        BadInput: If that is closed.
    """
    if output_is_closed():
        raise BadInput(f"{CLOSED}; open it")
    sys.stdout.write(json.dumps(data, indent=1, allow_nan=False) + "\n")


def set_up_logging(verbose: bool) -> None:
    """Send warnings to standard error, and everything of ours where the user wants to know more."""
    if messages.is_terminal:
        logging.basicConfig(level=logging.WARNING, format="%(message)s", force=True,
                            handlers=[RichHandler(console=messages, show_time=False, show_path=False)])
    else:  # a line each, whatever reads them
        handler = logging.StreamHandler()
        handler.setFormatter(_SafeFormatter("%(levelname)s %(message)s"))
        logging.basicConfig(level=logging.WARNING, handlers=[handler], force=True)
    logging.getLogger("sva_bench").setLevel(logging.DEBUG if verbose else logging.WARNING)


@contextmanager
def progress_bars() -> Iterator[OnProgress]:
    """Progress bars on standard error; plain lines where that is no terminal."""
    if not messages.is_terminal:
        said: set[str] = set()

        def say(what: str, done: int, of: int) -> None:
            if what not in said and done < of:
                said.add(what)
                messages.print(f"{what} ...", highlight=False)

        yield say
        return
    tasks: dict[str, TaskID] = {}

    def show(what: str, done: int, of: int) -> None:
        if what not in tasks:
            tasks[what] = bars.add_task(what, total=of)
        bars.update(tasks[what], completed=done, total=of)

    bars = Progress(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
                    console=messages, transient=True)
    try:
        with holding_back_ctrl_c():  # the thread that draws them inherits it: Ctrl-C is this one's to hear
            bars.start()
        yield show
    finally:
        bars.stop()


def print_summary(summary: AnySummary) -> None:
    """Print a summary as a table, and what it comes to."""
    from sva_bench.analysis.summaries import ComparisonSummary
    from sva_bench.report.wording import answer, ranked, remarks

    console, travel, failure = results(), summary.travel, summary.failure
    console.print(_plans_table(summary))
    console.print(f"{counted(travel.pairs, 'travel time')}, {travel.triangle_violations_pct:.1f} % repaired, by up to "
                  f"{travel.max_excess_pct:.1f} %; planned under {failure.plan}, executed under {failure.execute} "
                  "failures.", highlight=False)
    _print_unhappy(summary, console)
    if isinstance(summary, ComparisonSummary):
        for scenario in summary.scenarios:
            if scenario.comparisons:
                console.print(f"{scenario.name}: {ranked(scenario)}", highlight=False, markup=False)
    console.print(answer(summary), highlight=False)
    for said in remarks(summary):
        console.print(said, highlight=False)
    if not isinstance(summary, ComparisonSummary):
        _print_assumptions(summary, console)
    if not summary.reproducible:
        console.print("A solve met its limit: these plans may differ on another machine.", highlight=False)


def _plans_table(summary: AnySummary) -> Table:
    from sva_bench.analysis.catalogue import statistics
    from sva_bench.analysis.reach import lost_robots
    from sva_bench.analysis.results import ComparedScenario, GivenPlanResult
    from sva_bench.analysis.summaries import Summary
    from sva_bench.report.wording import cell, vss_verdict

    scenarios, shown = summary.scenarios, statistics("terminal")
    compared, given = isinstance(summary, Summary), not isinstance(summary, Summary)  # given plans may lose robots
    table = Table(title=f"{summary.world}, seed {summary.seed}: {counted(summary.trials, 'trial')}, "
                        f"{counted(summary.rollouts, 'rollout')}, {summary.fidelity}", title_justify="left")
    for heading in ("scenario", "plan", *(("robots lost",) if given else ()),
                    *(f"{entry.heading} [95 %]" if entry.interval else entry.heading for entry in shown),
                    *scenarios[0].availability, *(("VSS executed [95 %]", "VSS modelled", "EVPI") if compared else ())):
        table.add_column(heading, justify="left" if heading in ("scenario", "plan") else "right")
    for scenario in scenarios:
        for number, (name, plan) in enumerate(scenario.plans.items()):
            proof = "" if plan.status in ("optimal", None) else f" ({plan.status})"
            lost, worth = "", ["", "", ""]
            if isinstance(plan, GivenPlanResult):
                proof, lost = proof if plan.feasible else " (infeasible)", lost_robots(plan)
            if not number and not isinstance(scenario, ComparedScenario):
                worth = [vss_verdict(scenario.vss), f"{scenario.vss.modelled:.1f}",
                         "" if scenario.evpi is None else f"{scenario.evpi:.1f}"]
            table.add_row(
                "" if number else scenario.name, name + proof, *((lost,) if given else ()),
                *(cell(entry, plan) for entry in shown), *(f"{x:.1f}" for x in plan.by_robot.values()),
                *(worth if compared else ()), end_section=number == len(scenario.plans) - 1)
    return table


def _print_unhappy(summary: AnySummary, console: Console) -> None:
    """Say how many missions ended otherwise than home or by draw."""
    missions, unhappy = 0, []
    for name in summary.scenarios[0].plans:
        ends: Counter[str] = Counter()
        for scenario in summary.scenarios:
            ends.update(scenario.plans[name].ends)
        missions += ends.total()
        bad = [f"{ends[end]} {end}" for end in ("out_of_fuel", "late", "stuck") if ends[end]]
        if bad:
            unhappy.append(f"{', '.join(bad)} ({name})")
    if unhappy:
        console.print(f"Of {missions} robot missions ended otherwise than home or by draw: {'; '.join(unhappy)}.",
                      highlight=False)


def _print_assumptions(summary: Summary, console: Console) -> None:
    from sva_bench.report.wording import ASSUMPTION_HEAD, assumption_rows

    if rows := assumption_rows(summary.scenarios):
        crossed = Table(title="Plans under the failures they were made for and under the others", title_justify="left")
        for number, heading in enumerate(ASSUMPTION_HEAD):
            crossed.add_column(heading, justify="left" if number < 4 else "right")
        for row in rows:
            crossed.add_row(*row)
        console.print(crossed)
