"""The execution of a batch, from its grid to its summary; only this process writes."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path

from sva_bench.analysis.over_maps import BatchSummary, GivenUp, OverMaps
from sva_bench.batch.aggregates import aggregate, joined, summary_of, unit_summary
from sva_bench.batch.cache import Cache
from sva_bench.batch.compared import Asked, compared
from sva_bench.batch.conductor import Conductor, Hooks
from sva_bench.batch.folder import (
    begin,
    command_in,
    failures_in,
    locked,
    shard_path,
    units_in,
    write,
    write_failures,
    write_maps,
    writing,
)
from sva_bench.batch.grid import Grid, Point
from sva_bench.batch.shards import Note, Shard, read_note, unit_of
from sva_bench.batch.strands import Strand, strand
from sva_bench.files.pretty import pretty_json
from sva_bench.files.records import as_dict
from sva_bench.report.batch_page import write_batch_report
from sva_bench.workers.engine import Engine


@dataclass(frozen=True, eq=False, kw_only=True)
class BatchProgress:
    """The progress of a batch.

    Attributes:
        done, failed, units: Units completed, failed for good, and all.
        before: Units completed before this process started.
        seconds: Time since the start [s].
        vss: Computes the VSS over maps so far.
    """

    done: int
    failed: int
    units: int
    before: int
    seconds: float
    vss: Callable[[], Sequence[OverMaps]]

    @property
    def rate(self) -> float | None:
        """Units per second of this process; ``None`` before the first."""
        return (self.done - self.before) / self.seconds if self.done > self.before and self.seconds > 0 else None

    @property
    def left_s(self) -> float | None:
        """Estimated time left [s]; ``None`` before the first unit."""
        return None if self.rate is None else (self.units - self.done - self.failed) / self.rate


def run_batch(
    grid: Grid, folder: Path, engine: Callable[[], AbstractContextManager[Engine]], cache: Cache,
    report: Callable[[BatchProgress], None], *, resume: bool, retry: bool = False, compare: Sequence[Asked] = (),
) -> BatchSummary:
    """Execute every remaining unit of a grid, and write the summary.

    Args:
        grid: The grid.
        folder: The batch folder.
        engine: Opens the engine that runs the jobs; not called if nothing is left.
        cache: Cache of travel times, plans and drives.
        report: Called about twice a second.
        resume: Continue a batch in the folder.
        retry: Retry the units that failed.
        compare: The varied keys whose values are compared.

    Returns:
        The summary.

    Raises:
        BadInput: If the folder holds something else, is in use, or cannot be written to.
    """
    with locked(folder):
        begin(folder, grid.settings(), resume=resume or retry)
        write_maps(folder, grid.map_files())
        state = _BatchState(grid, folder, retry=retry)
        report(state.progress())
        if state.left:
            with engine() as running:
                Conductor(running, cache, Hooks(
                    shard=state.keep, unit_failed=state.unit_failed, strand_failed=state.strand_failed,
                    tick=lambda: report(state.progress()))).run(state.strands())
        return _written(grid, folder, state.done, state.failures, compare)


def report_again(grid: Grid, folder: Path, compare: Sequence[Asked]) -> BatchSummary:
    """Write summary and page of a batch again, from the shards of what is done.

    Raises:
        BadInput: If the batch is at work, or its folder cannot be written to.
        BadFile: If a shard is invalid.
    """
    with locked(folder):
        done = units_in(folder) & set(grid.units())
        return _written(grid, folder, done, [unit for unit in failures_in(folder) if unit.unit not in done], compare)


def _written(grid: Grid, folder: Path, done: set[str], failures: Sequence[GivenUp], compare: Sequence[Asked]
             ) -> BatchSummary:
    summary = summary_of(grid, folder, done, failures)
    summary = replace(summary, compared=compared(compare, grid, folder, done, summary.units))
    write(folder / "summary.json", pretty_json(as_dict(summary)).encode())
    with writing(folder / "report.html") as draft:
        write_batch_report(draft, summary, command_in(folder))
    return summary


class _BatchState:
    """Completed and failed units, and the joined notes so far."""

    def __init__(self, grid: Grid, folder: Path, *, retry: bool) -> None:
        self._grid, self._folder, self._begun = grid, folder, time.monotonic()
        self._owner = {grid.unit_name(point, seed, first): (point, seed, first)
                       for point, seed in grid.strands() for first, _ in grid.ranges()}
        self.done = units_in(folder) & set(self._owner)
        held = failures_in(folder)
        self.failures = [] if retry else [failure for failure in held if failure.unit not in self.done]
        if self.failures != held:
            write_failures(folder, self.failures)
        self._before = len(self.done)
        self._totals: dict[tuple[str, int], Note] = {}
        for unit, (point, seed, first) in self._owner.items():
            if unit in self.done:
                self._add(point.name, seed, read_note(shard_path(folder, unit), unit_of(grid, point, seed, first)))

    @property
    def left(self) -> bool:
        """Whether units are left."""
        return len(self.done) + len(self.failures) < len(self._owner)

    def strands(self) -> Iterator[tuple[Point, int, Strand]]:
        """The strands with units left."""
        finished = frozenset(self.done | {failure.unit for failure in self.failures})
        for point, seed in self._grid.strands():
            yield point, seed, strand(self._grid, point, seed, finished)

    def keep(self, unit: str, shard: Shard) -> None:
        """Write a unit's shard."""
        write(shard_path(self._folder, unit), shard.content)
        self.done.add(unit)
        point, seed, _ = self._owner[unit]
        self._add(point.name, seed, shard.note)

    def unit_failed(self, unit: str, reason: str, attempts: int) -> None:
        """Record that a unit failed for good."""
        point, seed, _ = self._owner[unit]
        self._add_failures([(unit, point, seed)], reason, attempts)

    def strand_failed(self, point: Point, seed: int, reason: str, attempts: int) -> None:
        """Record that the remaining units of a point and seed failed for good."""
        finished = self.done | {failure.unit for failure in self.failures}
        names = [self._grid.unit_name(point, seed, first) for first, _ in self._grid.ranges()]
        self._add_failures([(name, point, seed) for name in names if name not in finished], reason, attempts)

    def progress(self) -> BatchProgress:
        """The progress of the batch."""
        return BatchProgress(done=len(self.done), failed=len(self.failures), units=len(self._owner),
                             before=self._before, seconds=time.monotonic() - self._begun,
                             vss=lambda: aggregate([unit_summary(note) for note in self._totals.values()]))

    def _add_failures(self, units: list[tuple[str, Point, int]], reason: str, attempts: int) -> None:
        self.failures += [GivenUp(unit=unit, world=point.label, seed=seed, reason=reason, attempts=attempts)
                          for unit, point, seed in units]
        write_failures(self._folder, self.failures)

    def _add(self, point: str, seed: int, note: Note) -> None:
        known = self._totals.get((point, seed))
        self._totals[point, seed] = note if known is None else joined(known, note)
