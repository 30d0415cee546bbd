"""A batch as it is seen: a live table on a terminal, plain lines elsewhere, and the tables of its summary."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import timedelta

from rich.cells import cell_len
from rich.console import Console
from rich.live import Live
from rich.text import Text

from sva_bench.analysis.compared_values import KeyComparison
from sva_bench.analysis.over_maps import BatchSummary, GivenUp, OverMaps, ReactionOverMaps, UnitSummary
from sva_bench.analysis.reach import maps_without_reach
from sva_bench.batch.estimates import StrandCost, total_s
from sva_bench.batch.run import BatchProgress
from sva_bench.cli.sheets import Column, Sheet, fitted, print_sheet
from sva_bench.cli.terminal import messages, results
from sva_bench.files.printable import counted
from sva_bench.report.calibration_over_maps import calibrated_over_maps
from sva_bench.report.compared_values import compared_answers, compared_notes, compared_table, compared_title
from sva_bench.report.reactions_over_maps import reaction_table
from sva_bench.report.wording import over_few_maps, percentage, same_draws, verdict, with_interval

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
                messages.print(line(progress, messages.width), highlight=False, markup=False, soft_wrap=True)

        yield say
        return
    with Live(console=messages, transient=True, auto_refresh=False) as live:
        def show(progress: BatchProgress) -> None:
            greet(progress)
            if due(_TABLE_S):
                rows = progress.vss()
                live.update(Text("\n".join([how_far(progress), *so_far(rows, messages.width)])), refresh=True)

        yield show


def how_far(progress: BatchProgress) -> str:
    """Units done, failed, rate and time left."""
    text = f"{progress.done} of {counted(progress.units, 'unit')} done, {progress.failed} failed"
    if progress.rate is not None and progress.left_s is not None:
        text += f", {progress.rate:.2g} a second, {timedelta(seconds=round(progress.left_s))} left"
    return text


def line(progress: BatchProgress, width: int) -> str:
    """All of it in one line, with as much of the VSS as there is room for."""
    said = how_far(progress)
    for number, row in enumerate(progress.vss()):
        more = f"{', ' if number else '; VSS '}{row.label} {with_interval(row.vss)}"
        if cell_len(said + more) > width - len(_MORE):
            return said + _MORE
        said += more
    return said


_MORE = ", ..."
_MOST_SHOWN = 12


def so_far(rows: Sequence[OverMaps], width: int) -> list[str]:
    """The VSS over maps so far, in lines that fit a terminal; what came first, where there are many."""
    shown = [line for line, _ in fitted(over_maps(rows[:_MOST_SHOWN], ""), width)[0]] if rows else []
    return [*shown, f"and {len(rows) - _MOST_SHOWN} more"] if len(rows) > _MOST_SHOWN else shown


def over_maps(rows: Sequence[OverMaps], title: str) -> Sheet:
    """The VSS over maps as a table."""
    varied = any(row.variant for row in rows)
    before: list[str] = [""]
    cells = []
    for row in rows:
        cells.append([*(["" if row.variant == before[-1] else row.variant] if varied else []), row.scenario,
                      str(row.maps), with_interval(row.vss), percentage(row.vss_pct)])
        before.append(row.variant)
    return Sheet(title=title, rows=cells, columns=[
        *([Column(heading="variant", words=True, above=True)] if varied else []),
        Column(heading="scenario", words=True, above=True), Column(heading="maps"), Column(heading="VSS [95 %]"),
        Column(heading="VSS % [95 %]", last=1)])


def reactions_over_maps(rows: Sequence[ReactionOverMaps]) -> Sheet:
    """What reacting is worth over maps, as a table."""
    head, words, cells = reaction_table(rows, narrow=True)
    return Sheet(title="Reactions over maps", rows=cells, columns=[
        Column(heading=heading, words=k in words, above=k in words) for k, heading in enumerate(head)],
        ends=frozenset(range(len(cells))) if len(words) > 2 else frozenset())


def print_compared(comparisons: Sequence[KeyComparison], console: Console, *, wide: bool = False) -> None:
    """Print what the values of varied keys are worth."""
    for found in comparisons:
        head, words, cells = compared_table(found)
        spare = {"VSS [95 %]": 2, "maps": 3}
        rows = [["" if k and column in words and row[:column + 1] == cells[k - 1][:column + 1] else cell
                 for column, cell in enumerate(row)] for k, row in enumerate(cells)]  # names are said once
        print_sheet(Sheet(title=compared_title(found), rows=rows, columns=[
            Column(heading=heading, words=k in words, above=k in words, last=spare.get(heading, 0))
            for k, heading in enumerate(head)]), console, wide=wide)
        for said in compared_answers(found):
            console.print(said, highlight=False)
    for said in compared_notes(comparisons):
        console.print(said, highlight=False)


def print_batch(summary: BatchSummary, console: Console | None = None, *, wide: bool = False) -> None:
    """Print a batch: the VSS map by map, over maps, and what failed; ``wide``: all columns, however wide that is."""
    console = console or results()
    print_sheet(_map_by_map(summary), console, wide=wide)
    print_sheet(over_maps(summary.aggregate, "VSS over maps"), console, wide=wide)
    print_compared(summary.compared, console, wide=wide)
    if summary.reactions:
        print_sheet(reactions_over_maps(summary.reactions), console, wide=wide)
    for said in filter(None, (over_few_maps(summary.aggregate), same_draws(summary))):
        console.print(said, highlight=False, markup=False)
    for said in calibrated_over_maps(summary.units):
        console.print(said, highlight=False, markup=False)
    for said in maps_without_reach([unit.label for unit in summary.units if unit.reach.nothing]):
        console.print(said, highlight=False, markup=False)
    print_failed(summary.failed, console)


def _map_by_map(summary: BatchSummary) -> Sheet:
    worlds, seeds = len(summary.worlds), len(summary.seeds)
    varied = any(row.variant for row in summary.maps)
    means = _means(summary.units)
    before, rows, ends = None, list[list[str]](), set[int]()
    for row in summary.maps:
        this = (row.world, row.variant)
        if before is not None and this != before:
            ends.add(len(rows) - 1)
        name = [row.world, *([row.variant] if varied else [])]
        plans = means[row.variant, row.world, row.scenario]
        rows.append([*(name if this != before else [""] * len(name)), row.scenario, *(f"{mean:.1f}" for mean in plans),
                     verdict(row.vss, distinguishable=row.vss.excludes_zero, same=row.vss.same_plan),
                     "" if row.vss_pct is None else f"{row.vss_pct:.1f}"])
        before = this
    return Sheet(title=f"{counted(worlds, 'world')}, {counted(seeds, 'seed')}, {counted(summary.trials, 'trial')}, "
                       f"{summary.fidelity}", rows=rows, ends=frozenset(ends), columns=[
        Column(heading="world", words=True, above=not varied),
        *([Column(heading="variant", words=True, above=True)] if varied else []),
        Column(heading="scenario", words=True, above=True),
        Column(heading="stochastic"), Column(heading="deterministic"), Column(heading="VSS [95 %]"),
        Column(heading="VSS %", last=1)])


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


def print_grid(listed: Sequence[StrandCost], *, wide: bool = False) -> None:
    """Print what a batch would do, and take."""
    console = results()
    names = [(e.point.world.name, e.point.variant) for e in listed]
    varied = any(variant for _, variant in names)
    print_sheet(Sheet(title="the grid", columns=[
        Column(heading="world", words=True, above=not varied),
        *([Column(heading="variant", words=True, above=True)] if varied else []), Column(heading="seed"),
        Column(heading="units"), Column(heading="rows"), Column(heading="disk [MB]", last=1),
        Column(heading="processor time [s]")], rows=[
        [*([""] * (1 + varied) if number and names[number] == names[number - 1] else names[number][:1 + varied]),
         str(e.seed), str(e.units), str(e.rows), f"{e.disk_bytes / 1e6:.1f}", f"{e.processor_s:.1f}"]
        for number, e in enumerate(listed[:_MOST_LISTED])]), console, wide=wide)
    if len(listed) > _MOST_LISTED:
        console.print(f"and {len(listed) - _MOST_LISTED} more", highlight=False)
    seconds = total_s(listed)
    console.print(f"{counted(sum(e.units for e in listed), 'unit')}, {counted(sum(e.rows for e in listed), 'row')}; "
                  f"about {sum(e.disk_bytes for e in listed) / 1e6:.1f} MB and {timedelta(seconds=round(seconds))} of "
                  "processor time, to be divided by the number of workers. Time is rough until travel times and plans "
                  "are in the cache.", highlight=False)


_MOST_LISTED = 200


def _means(units: Sequence[UnitSummary]) -> dict[tuple[str, str, str], list[float]]:
    """What each plan collected, on average over seeds."""
    found: dict[tuple[str, str, str], list[list[float]]] = {}
    for unit in units:
        for scenario in unit.scenarios:
            found.setdefault((unit.variant, unit.world, scenario.name), []).append(
                [plan.executed.mean for plan in (scenario.stochastic, scenario.deterministic)])
    return {key: [sum(column) / len(rows) for column in zip(*rows, strict=True)] for key, rows in found.items()}
