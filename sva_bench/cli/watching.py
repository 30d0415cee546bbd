"""A batch as it is seen: a live table on a terminal, plain lines elsewhere, and the tables of its summary."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import timedelta

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from sva_bench.analysis.over_maps import BatchSummary, GivenUp, OverMaps, ReactionOverMaps, UnitSummary
from sva_bench.analysis.reach import maps_without_reach
from sva_bench.batch.estimates import StrandCost
from sva_bench.batch.run import BatchProgress
from sva_bench.cli.terminal import messages, results
from sva_bench.files.printable import counted
from sva_bench.report.calibration_over_maps import calibrated_over_maps
from sva_bench.report.reactions_over_maps import reaction_table
from sva_bench.report.wording import over_few_maps, percentage, verdict, with_interval

_LINE_S = 10.0
"""Time between two plain lines [s]."""
_TABLE_S = 1.0


@contextmanager
def watching() -> Iterator[Callable[[BatchProgress], None]]:
    """Shows how far a batch is, on standard error."""
    begun, shown = False, time.monotonic()

    def due(every_s: float) -> bool:
        nonlocal shown
        if time.monotonic() - shown < every_s:
            return False
        shown = time.monotonic()
        return True

    def greet(progress: BatchProgress) -> None:
        nonlocal begun
        if not begun and progress.done:
            messages.print(f"{progress.done} of {counted(progress.units, 'unit')} measured already", highlight=False)
        begun = True

    if not messages.is_terminal:
        def say(progress: BatchProgress) -> None:
            greet(progress)
            if due(_LINE_S):
                messages.print(line(progress), highlight=False, markup=False, soft_wrap=True)

        yield say
        return
    with Live(console=messages, transient=True, auto_refresh=False) as live:
        def show(progress: BatchProgress) -> None:
            greet(progress)
            if due(_TABLE_S):
                rows = progress.vss()
                tables = [over_maps(rows, "VSS over maps, so far")] if rows else []
                live.update(Group(Text(how_far(progress)), *tables), refresh=True)

        yield show


def how_far(progress: BatchProgress) -> str:
    """Units done, failed, rate and time left."""
    text = f"{progress.done} of {counted(progress.units, 'unit')} done, {progress.failed} failed"
    if progress.rate is not None and progress.left_s is not None:
        text += f", {progress.rate:.2g} a second, {timedelta(seconds=round(progress.left_s))} left"
    return text


def line(progress: BatchProgress) -> str:
    """All of it in one line."""
    rows = [f"{row.label} {with_interval(row.vss)}" for row in progress.vss()]
    return how_far(progress) + (f"; VSS over maps so far: {', '.join(rows)}" if rows else "")


def over_maps(rows: Sequence[OverMaps], title: str) -> Table:
    """The VSS over maps as a table."""
    varied = any(row.variant for row in rows)
    table = Table(title=title, title_justify="left")
    for heading in (*(("variant",) if varied else ()), "scenario", "maps", "VSS [95 %]", "VSS % [95 %]"):
        table.add_column(heading, justify="left" if heading in ("scenario", "variant") else "right")
    for row in rows:
        table.add_row(*((Text(row.variant),) if varied else ()), row.scenario, str(row.maps),
                      with_interval(row.vss), percentage(row.vss_pct))
    return table


def reactions_over_maps(rows: Sequence[ReactionOverMaps]) -> Table:
    """What reacting is worth over maps, as a table."""
    varied = any(row.variant for row in rows)
    head, words, cells = reaction_table(rows, narrow=True)
    table = Table(title="Reactions over maps", title_justify="left")
    for number, heading in enumerate(head):
        table.add_column(heading, justify="left" if number in words else "right", overflow="fold")
    for row in cells:
        table.add_row(*(Text(cell) if varied and not k else cell for k, cell in enumerate(row)))
    return table


def print_batch(summary: BatchSummary, console: Console | None = None) -> None:
    """Print a batch: the VSS map by map, over maps, and what failed."""
    console = console or results()
    console.print(_map_by_map(summary))
    console.print(over_maps(summary.aggregate, "VSS over maps"))
    if summary.reactions:
        console.print(reactions_over_maps(summary.reactions))
    if said := over_few_maps(summary.aggregate):
        console.print(said, highlight=False)
    for said in calibrated_over_maps(summary.units):
        console.print(said, highlight=False, markup=False)
    for said in maps_without_reach([unit.label for unit in summary.units if unit.reach.nothing]):
        console.print(said, highlight=False, markup=False)
    print_failed(summary.failed, console)


def _map_by_map(summary: BatchSummary) -> Table:
    worlds, seeds = len(summary.worlds), len(summary.seeds)
    varied = any(row.variant for row in summary.maps)
    table = Table(title=f"{counted(worlds, 'world')}, {counted(seeds, 'seed')}, "
                        f"{counted(summary.trials, 'trial')}, {summary.fidelity}", title_justify="left")
    for heading in ("world", *(("variant",) if varied else ()), "scenario", "stochastic", "deterministic",
                    "VSS [95 %]", "VSS %"):
        # Names of worlds tell them apart by their ends.
        table.add_column(heading, justify="left" if heading in ("world", "variant", "scenario") else "right",
                         overflow="fold")
    means = _means(summary.units)
    before = None
    for row in summary.maps:
        this = (row.world, row.variant)
        if before is not None and this != before:
            table.add_section()
        name: list[str | Text] = [row.world, *([Text(row.variant)] if varied else [])]
        plans = means[row.variant, row.world, row.scenario]
        table.add_row(*(name if this != before else [""] * len(name)), row.scenario,
                      *(f"{mean:.1f}" for mean in plans),
                      verdict(row.vss, distinguishable=row.vss.excludes_zero, same=row.vss.same_plan),
                      "" if row.vss_pct is None else f"{row.vss_pct:.1f}")
        before = this
    return table


def print_failed(failed: Sequence[GivenUp], console: Console, most: int = 20) -> None:
    """Print the units that were given up, and why."""
    if not failed:
        return
    console.print(f"{len(failed)} unit{'s were' if len(failed) > 1 else ' was'} given up (batch retry takes "
                  f"{'them' if len(failed) > 1 else 'it'} up again):", highlight=False)
    for entry in failed[:most]:
        console.print(f"  {entry.unit}: {entry.world}, seed {entry.seed}: {entry.reason} "
                      f"({entry.attempts} attempt{'s' if entry.attempts > 1 else ''})", highlight=False,
                      markup=False, soft_wrap=True)
    if len(failed) > most:
        console.print(f"  and {len(failed) - most} more: see failures.json", highlight=False)


def print_grid(listed: Sequence[StrandCost]) -> None:
    """Print what a batch would do, and take."""
    console = results()
    table = Table(title="the grid", title_justify="left")
    for heading in ("world", "variant", "seed", "units", "rows", "disk [MB]", "processor time [s]"):
        table.add_column(heading, justify="left" if heading in ("world", "variant") else "right")
    for e in listed[:_MOST_LISTED]:
        table.add_row(e.point.world.name, Text(e.point.variant), str(e.seed), str(e.units), str(e.rows),
                      f"{e.disk_bytes / 1e6:.1f}", f"{e.processor_s:.0f}")
    console.print(table)
    if len(listed) > _MOST_LISTED:
        console.print(f"and {len(listed) - _MOST_LISTED} more", highlight=False)
    seconds = sum(e.processor_s for e in listed)
    console.print(f"{counted(sum(e.units for e in listed), 'unit')}, {counted(sum(e.rows for e in listed), 'row')}; "
                  f"about {sum(e.disk_bytes for e in listed) / 1e6:.1f} MB and {timedelta(seconds=round(seconds))} of "
                  "processor time, to be divided by the number of workers. Time is rough until travel times and plans "
                  "are in the cache.", highlight=False, soft_wrap=True)


_MOST_LISTED = 200


def _means(units: Sequence[UnitSummary]) -> dict[tuple[str, str, str], list[float]]:
    """What each plan collected, on average over seeds."""
    found: dict[tuple[str, str, str], list[list[float]]] = {}
    for unit in units:
        for scenario in unit.scenarios:
            found.setdefault((unit.variant, unit.world, scenario.name), []).append(
                [plan.executed.mean for plan in (scenario.stochastic, scenario.deterministic)])
    return {key: [sum(column) / len(rows) for column in zip(*rows, strict=True)] for key, rows in found.items()}
