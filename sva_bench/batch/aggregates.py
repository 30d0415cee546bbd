"""Summaries of a batch, from the tallies in its shards: memory doesn't grow with trials."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from sva_bench.analysis.moments import Figure, pooled
from sva_bench.analysis.over_maps import (
    BATCH,
    BATCH_OF_REACTIONS,
    BatchSummary,
    GivenUp,
    MapRow,
    MapVss,
    OverMaps,
    UnitSummary,
)
from sva_bench.analysis.results import Estimate
from sva_bench.analysis.scenarios import UnitScenario
from sva_bench.analysis.statistics import estimate
from sva_bench.batch.folder import shard_path
from sva_bench.batch.grid import Grid
from sva_bench.batch.map_samples import in_per_cent, over_maps, percentage_over_maps
from sva_bench.batch.reactions_over_maps import reactions_over_maps
from sva_bench.batch.shards import Note, read_note, unit_of
from sva_bench.batch.tallies import join, scenario_of


def summary_of(grid: Grid, folder: Path, done: frozenset[str] | set[str], failures: Sequence[GivenUp]) -> BatchSummary:
    """The summary of a batch, from the shards of its completed units.

    Shards are joined in the order of the grid, so that sums don't depend on the order in which they were written.
    """
    notes = list(_notes(grid, folder, done))
    units = [unit_summary(note) for note in notes]
    reactions = reactions_over_maps(units)
    return BatchSummary(
        format=BATCH_OF_REACTIONS if reactions else BATCH,
        trials=grid.options.trials, fidelity=grid.options.fidelity,
        worlds=tuple(dict.fromkeys(point.world.name for point in grid.points)), seeds=tuple(grid.seeds),
        variants=tuple(dict.fromkeys(point.variant for point in grid.points)), units=tuple(units),
        settings={point.variant: dict(point.settings) for point in grid.points if point.settings},
        maps=map_rows(units, over_seeds(notes)), aggregate=aggregate(units),
        failed=tuple(failures), reactions=reactions)


def _notes(grid: Grid, folder: Path, done: frozenset[str] | set[str]) -> Iterator[Note]:
    """The joined notes of each point and seed with completed trials."""
    ranges = grid.ranges()
    for point, seed in grid.strands():
        combined: Note | None = None
        for first, _ in ranges:
            unit = grid.unit_name(point, seed, first)
            if unit in done:
                note = read_note(shard_path(folder, unit), unit_of(grid, point, seed, first))
                combined = note if combined is None else joined(combined, note)
        if combined is not None:
            yield combined


def joined(a: Note, b: Note) -> Note:
    """The note of two ranges of trials of one point and seed."""
    return Note(facts=a.facts, variant=a.variant, robots=a.robots, first=min(a.first, b.first),
                trials=a.trials + b.trials, reactions=a.reactions or b.reactions,
                tallies={name: join(tally, b.tallies[name]) for name, tally in a.tallies.items()})


def unit_summary(note: Note) -> UnitSummary:
    """The summary of one point and seed."""
    facts = note.facts
    return UnitSummary(
        world=facts.world, seed=facts.seed, trials=note.trials, rollouts=facts.rollouts, fidelity=facts.fidelity,
        failure=facts.failure, travel=facts.travel, reproducible=facts.reproducible, reach=facts.reach,
        variant=note.variant, scenarios=tuple(
            scenario_of(scenario, note.tallies[scenario.name], note.robots, note.reactions.get(scenario.name),
                        facts.calibrations.get(scenario.name))
            for scenario in facts.scenarios))


def aggregate(units: Sequence[UnitSummary]) -> tuple[OverMaps, ...]:
    """VSS over maps, for each variant and scenario: the maps are the sample, seeds and trials are nested in them.

    The interval is that of the mean over maps, of each map's mean over its seeds, and allows for the draws that maps
    share (``map_samples.over_maps``). A map on which the stochastic plan collects nothing has no percentage; the number
    of maps with one is then given.
    Where every robot is certain, both plans are equal on any map; otherwise maps with equal values don't show
    how maps vary, and there is no interval.
    """
    doubtful = {(unit.variant, s.name) for unit in units for s in unit.scenarios
                if any(p < 1 for p in s.availability.values())}
    rows = []
    for (variant, scenario), by_map in _by_map(units).items():
        certain = (variant, scenario) not in doubtful
        vss = [[seed.vss.executed for seed in seeds] for seeds in by_map.values()]
        shares = [[in_per_cent(seed.vss.executed, seed.vss.executed_pct, seed.stochastic.executed.mean)
                   for seed in seeds] for seeds in by_map.values()]
        rows.append(OverMaps(variant=variant, scenario=scenario, maps=len(by_map), vss=over_maps(vss, sure=certain),
                             vss_pct=percentage_over_maps(shares, sure=certain)))
    return tuple(rows)


Key = tuple[str, str, str]
"""A variant, a scenario, and a map's name."""


def over_seeds(notes: Sequence[Note]) -> dict[Key, Estimate]:
    """Executed VSS of each map over the trials of all its seeds, whose failures and noise draws are independent."""
    combined: dict[Key, Figure] = {}
    for note in notes:
        for scenario, tally in note.tallies.items():
            key = note.variant, scenario, note.facts.world
            combined[key] = pooled(combined[key], tally.difference) if key in combined else tally.difference
    return {key: estimate(figure) for key, figure in combined.items()}


def map_rows(units: Sequence[UnitSummary], executed: Mapping[Key, Estimate]) -> tuple[MapRow, ...]:
    """VSS map by map.

    Args:
        units: Summaries, a map and seed at a time.
        executed: From ``over_seeds``.
    """
    rows = []
    for (variant, scenario), by_map in _by_map(units).items():
        for world, seeds in by_map.items():
            found = executed[variant, scenario, world]
            pct = [seed.vss.executed_pct for seed in seeds if seed.vss.executed_pct is not None]
            rows.append(MapRow(
                variant=variant, world=world, scenario=scenario, seeds=len(seeds), vss_pct=float(np.mean(pct)) if pct
                else None, vss=MapVss(mean=found.mean, ci95=found.ci95, same_plan=all(s.vss.same_plan for s in seeds))))
    worlds, variants = ({name: number for number, name in enumerate(dict.fromkeys(names))} for names in (
        [unit.world for unit in units], [unit.variant for unit in units]))
    return tuple(sorted(rows, key=lambda row: (worlds[row.world], variants[row.variant])))


def _by_map(units: Sequence[UnitSummary]) -> dict[tuple[str, str], dict[str, list[UnitScenario]]]:
    """Results seed by seed, by variant and scenario, then by map."""
    found: dict[tuple[str, str], dict[str, list[UnitScenario]]] = {}
    for unit in units:
        for scenario in unit.scenarios:
            found.setdefault((unit.variant, scenario.name), {}).setdefault(unit.world, []).append(scenario)
    return found
