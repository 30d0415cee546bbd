"""What a batch comes to, streamed from the tallies in its shards: memory doesn't grow with trials."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sva_bench.analysis.moments import Figure, pooled
from sva_bench.analysis.statistics import Estimate, estimate, sample_mean
from sva_bench.batch.folder import Failure, shard_path
from sva_bench.batch.grid import Grid
from sva_bench.batch.shards import Note, read_note, unit_of
from sva_bench.batch.tallies import join, scenario_from

KIND = "sva-bench/batch@1"


def summary_of(grid: Grid, folder: Path, done: frozenset[str] | set[str], failures: Sequence[Failure]
               ) -> dict[str, Any]:
    """The content of ``summary.json``, from the shards of the units that are done.

    Shards are joined in the order of the grid, whatever the order they were written in, so the sums are the same.
    """
    notes = list(_notes(grid, folder, done))
    entries = [entry_of(note) for note in notes]
    return {
        "format": KIND, "trials": grid.options.trials, "fidelity": grid.options.fidelity,
        "worlds": list(dict.fromkeys(point.world.name for point in grid.points)), "seeds": list(grid.seeds),
        "variants": list(dict.fromkeys(point.variant for point in grid.points)),
        "units": entries, "maps": maps(entries, over_seeds(notes)), "aggregate": aggregate(entries),
        "failed": [{"unit": f.unit, "world": f.world, "seed": f.seed, "reason": f.reason, "attempts": f.attempts}
                   for f in failures],
    }


def _notes(grid: Grid, folder: Path, done: frozenset[str] | set[str]) -> Iterator[Note]:
    """What is known of each point and seed of which some trials are done."""
    ranges = grid.ranges()
    for point, seed in grid.strands():
        together: Note | None = None
        for first, _ in ranges:
            unit = grid.unit_name(point, seed, first)
            if unit in done:
                note = read_note(shard_path(folder, unit), unit_of(grid, point, seed, first))
                together = note if together is None else joined(together, note)
        if together is not None:
            yield together


def joined(a: Note, b: Note) -> Note:
    """Two ranges of trials of one point and seed together."""
    return Note(facts=a.facts, variant=a.variant, robots=a.robots, first=min(a.first, b.first),
                trials=a.trials + b.trials,
                tallies={name: join(tally, b.tallies[name]) for name, tally in a.tallies.items()})


def entry_of(note: Note) -> dict[str, Any]:
    """The summary of one point and seed."""
    return {**note.facts, "variant": note.variant, "trials": note.trials, "scenarios": [
        scenario_from(fact, note.tallies[fact["name"]], note.robots) for fact in note.facts["scenarios"]]}


def aggregate(entries: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """VSS over maps, for each variant and scenario: the maps are the sample, seeds and trials are nested in them.

    The interval is that of a mean over maps, each map's figure being the mean over its seeds. A map where the
    stochastic plan collects nothing has no percentage: then those are over fewer maps, and say over how many.
    Where every robot is sure to be there, both plans are the same on any map; elsewhere maps that agree leave open
    how maps differ, and there is no interval.
    """
    sure = {(e.get("variant", ""), s["name"]) for e in entries for s in e["scenarios"]}
    sure -= {(e.get("variant", ""), s["name"]) for e in entries for s in e["scenarios"]
             if any(p < 1 for p in s["availability"].values())}
    rows = []
    for (variant, scenario), by_map in _figures(entries).items():
        certain = (variant, scenario) in sure
        vss = [float(np.mean([mean for mean, _ in figures])) for figures in by_map.values()]
        shares = [[pct for _, pct in figures if pct is not None] for figures in by_map.values()]
        pcts = [float(np.mean(pct)) for pct in shares if pct]
        rows.append({"variant": variant, "scenario": scenario, "maps": len(by_map),
                     "vss": over(vss, sure=certain),
                     "vss_pct": over(pcts, sure=certain) | ({} if len(pcts) == len(by_map) else {"maps": len(pcts)})})
    return rows


Key = tuple[str, str, str]
"""A variant, a scenario, and a map's name."""


def over_seeds(notes: Sequence[Note]) -> dict[Key, Estimate]:
    """Executed VSS of each map over the trials of all its seeds: each has failures and noise draws of its own."""
    together: dict[Key, Figure] = {}
    for note in notes:
        for scenario, tally in note.tallies.items():
            key = note.variant, scenario, note.facts["world"]
            together[key] = pooled(together[key], tally.difference) if key in together else tally.difference
    return {key: estimate(figure) for key, figure in together.items()}


def maps(entries: Sequence[Mapping[str, Any]], executed: Mapping[Key, Estimate]) -> list[dict[str, Any]]:
    """VSS map by map.

    Args:
        entries: Summaries, a map and seed at a time.
        executed: As ``over_seeds`` gives it.
    """
    differing = {(e.get("variant", ""), s["name"], e["world"]) for e in entries for s in e["scenarios"]
                 if not s["vss"]["same_plan"]}
    rows = []
    for (variant, scenario), by_map in _figures(entries).items():
        for world, figures in by_map.items():
            key = variant, scenario, world
            pct = [share for _, share in figures if share is not None]
            rows.append({
                "variant": variant, "world": world, "scenario": scenario, "seeds": len(figures),
                "vss": executed[key].as_dict() | {"same_plan": key not in differing},
                "vss_pct": float(np.mean(pct)) if pct else None})
    order = {world: number for number, world in enumerate(dict.fromkeys(e["world"] for e in entries))}
    return sorted(rows, key=lambda row: (order[row["world"]], row["variant"]))


Figures = dict[tuple[str, str], dict[str, list[tuple[float, float | None]]]]


def _figures(entries: Sequence[Mapping[str, Any]]) -> Figures:
    """Mean and percentage of the executed VSS, seed by seed, by variant and scenario, then by map."""
    found: Figures = {}
    for entry in entries:
        for scenario in entry["scenarios"]:
            vss = scenario["vss"]
            found.setdefault((entry.get("variant", ""), scenario["name"]), {}).setdefault(entry["world"], []).append(
                (vss["executed"]["mean"], vss["executed_pct"]))
    return found


def over(figures: Sequence[float], *, sure: bool) -> dict[str, Any]:
    """Mean of a sample of maps, with its interval; ``sure`` where no map could have another figure."""
    if not figures:
        return {"mean": None, "ci95": None}
    found = sample_mean(figures).as_dict()
    alike = sure and len(figures) > 1 and len(set(figures)) == 1
    return {**found, "ci95": [found["mean"]] * 2} if alike else found
