"""What a batch comes to, streamed from the tallies in its shards: memory doesn't grow with trials."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import t as student_t

from sva_bench.analysis.statistics import CONFIDENCE
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
    entries = list(_entries(grid, folder, done))
    return {
        "format": KIND, "trials": grid.options.trials, "fidelity": grid.options.fidelity,
        "worlds": list(dict.fromkeys(point.world.name for point in grid.points)), "seeds": list(grid.seeds),
        "variants": list(dict.fromkeys(point.variant for point in grid.points)),
        "units": entries, "maps": maps(entries), "aggregate": aggregate(entries),
        "failed": [{"unit": f.unit, "world": f.world, "seed": f.seed, "reason": f.reason, "attempts": f.attempts}
                   for f in failures],
    }


def _entries(grid: Grid, folder: Path, done: frozenset[str] | set[str]) -> Iterator[dict[str, Any]]:
    """A summary for each point and seed of which some trials are done."""
    ranges = grid.ranges()
    for point, seed in grid.strands():
        together: Note | None = None
        for first, _ in ranges:
            unit = grid.unit_name(point, seed, first)
            if unit in done:
                note = read_note(shard_path(folder, unit), unit_of(grid, point, seed, first))
                together = note if together is None else joined(together, note)
        if together is not None:
            yield entry_of(together)


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
    """
    rows = []
    for (variant, scenario), by_map in _figures(entries).items():
        vss = [float(np.mean([mean for mean, _ in figures])) for figures in by_map.values()]
        shares = [[pct for _, pct in figures if pct is not None] for figures in by_map.values()]
        pcts = [float(np.mean(pct)) for pct in shares if pct]
        rows.append({"variant": variant, "scenario": scenario, "maps": len(by_map), "vss": over(vss),
                     "vss_pct": over(pcts) | ({} if len(pcts) == len(by_map) else {"maps": len(pcts)})})
    return rows


def maps(entries: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """VSS map by map: over its seeds where there are several, else over its trials."""
    within = {(e.get("variant", ""), s["name"], e["world"]): s["vss"] for e in entries for s in e["scenarios"]}
    differing = {(e.get("variant", ""), s["name"], e["world"]) for e in entries for s in e["scenarios"]
                 if not s["vss"]["same_plan"]}
    rows = []
    for (variant, scenario), by_map in _figures(entries).items():
        for world, figures in by_map.items():
            key = variant, scenario, world
            vss = dict(within[key]["executed"]) if len(figures) == 1 else over([mean for mean, _ in figures])
            pct = [share for _, share in figures if share is not None]
            rows.append({
                "variant": variant, "world": world, "scenario": scenario, "seeds": len(figures),
                "vss": vss | {"same_plan": key not in differing},
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


def over(figures: Sequence[float]) -> dict[str, Any]:
    """Mean of a sample, with its interval by Student's t."""
    if not figures:
        return {"mean": None, "ci95": None}
    mean, n = float(np.mean(figures)), len(figures)
    if n < 2:
        return {"mean": mean + 0.0, "ci95": None}
    half = float(student_t.ppf(0.5 + CONFIDENCE / 2, n - 1)) * float(np.std(figures, ddof=1)) / n**0.5
    return {"mean": mean + 0.0, "ci95": [mean - half, mean + half]}
