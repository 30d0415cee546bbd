"""Many worlds and seeds over an executor: one shard of outcomes a unit, resumable."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import t as student_t

from sva_bench import __version__
from sva_bench.analysis.report import write_batch_report
from sva_bench.analysis.statistics import CONFIDENCE
from sva_bench.bench import Measured, measure
from sva_bench.documents import read_json
from sva_bench.errors import BadFile, BadInput
from sva_bench.planning import Options
from sva_bench.runs import read_shard, write_json, write_shard
from sva_bench.world.load import world_as_dict
from sva_bench.world.model import World

KIND = "sva-bench/batch@1"
Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False, kw_only=True)
class Unit:
    """One world with one seed: it depends on nothing but its content."""

    world: World
    options: Options

    @property
    def name(self) -> str:
        """Part of its shard's file name."""
        return f"{self.world.name}-seed{self.options.seed}"


def run_batch(
    worlds: Sequence[World], seeds: Sequence[int], options: Options, folder: Path, executor: Executor | None,
    progress: Progress, *, resume: bool,
) -> dict[str, Any]:
    """Measure every world with every seed and aggregate over the worlds.

    Each unit's outcomes become a shard as soon as it is done, written under a temporary name and renamed; only this
    process writes.

    Args:
        worlds: The worlds; names must differ.
        seeds: The seeds.
        options: All else, the same for all units.
        folder: The batch folder.
        executor: Where units run; ``None`` = here.
        progress: Called with the number of units done and of all.
        resume: Go on with what the folder holds.

    Returns:
        The content of ``summary.json``.

    Raises:
        BadInput: If worlds share a name, or the folder holds something else.
    """
    names = [world.name for world in worlds]
    for name in names:
        if names.count(name) > 1:
            raise BadInput(f"two worlds are named {name!r}; names must differ within a batch")
    units = [Unit(world=world, options=replace(options, seed=seed)) for world in worlds for seed in seeds]
    done = _begin(folder, settings_of(worlds, seeds, options), resume=resume)
    left = [unit for unit in units if unit.name not in done]
    finished = len(units) - len(left)
    progress(finished, len(units))
    for unit, measured in _measure_all(left, executor):
        write_shard(folder / f"outcomes-{unit.name}.parquet", measured.executed, unit.world, unit.options.seed,
                    unit.options.fidelity, measured.summary)
        finished += 1
        progress(finished, len(units))
    summaries = [read_shard(folder / f"outcomes-{unit.name}.parquet") for unit in units]
    summary = {"format": KIND, "trials": options.trials, "fidelity": options.fidelity, "worlds": names,
               "seeds": list(seeds), "units": summaries, "aggregate": aggregate(summaries)}
    write_json(folder / "summary.json", summary)
    write_batch_report(folder / "report.html", summary)
    return summary


def settings_of(worlds: Sequence[World], seeds: Sequence[int], options: Options) -> dict[str, Any]:
    """Everything that the rows of a batch depend on."""
    files = {world.name: world.map_source.digests() for world in worlds if world.map_source is not None}
    return {"version": __version__, "worlds": {world.name: world_as_dict(world) for world in worlds},
            **({"files": files} if files else {}), "seeds": list(seeds), "options": options.as_dict()}


def batch_name(settings: Mapping[str, Any]) -> str:
    """Default name of a batch folder: equal batches get equal names."""
    return f"batch-{hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()[:8]}"


def _begin(folder: Path, settings: Mapping[str, Any], *, resume: bool) -> set[str]:
    """Make the folder ready; returns the names of the units that it holds already."""
    manifest = folder / "manifest.json"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        held = [path for path in folder.iterdir() if path.suffix != ".tmp"]
        if held and not resume:
            raise BadInput(f"{folder}: the folder isn't empty; go on with --resume, or choose another with --out")
        for draft in folder.glob("*.tmp"):
            draft.unlink()
        if held:
            _refuse_other_settings(manifest, settings)
        else:
            draft = manifest.with_name(manifest.name + ".tmp")
            write_json(draft, {"format": "sva-bench/batch-manifest@1", "settings": dict(settings)})
            draft.replace(manifest)
    except OSError as error:
        raise BadInput(f"{folder}: cannot be written to ({error.strerror}); choose another with --out") from None
    return {path.stem.removeprefix("outcomes-") for path in held if path.name.startswith("outcomes-")}


def _refuse_other_settings(manifest: Path, settings: Mapping[str, Any]) -> None:
    document = read_json(manifest)
    held = document.data.get("settings") if isinstance(document.data, dict) else None
    if not isinstance(held, dict):
        raise BadFile(manifest, None, "settings", "this is no batch folder of ours; choose another with --out")
    now = json.loads(json.dumps(settings))
    if held != now:
        raise BadFile(manifest, None, _difference(held, now), "differs from the batch in this folder; use the same "
                      "settings, or choose another folder with --out")


def _difference(held: Any, now: Any, key: str = "settings") -> str:
    """The first key at which two settings differ."""
    if isinstance(held, dict) and isinstance(now, dict):
        for name in [*held, *(name for name in now if name not in held)]:
            if held.get(name) != now.get(name):
                return _difference(held.get(name), now.get(name), f"{key}.{name}")
    return key


def _measure_all(units: Iterable[Unit], executor: Executor | None) -> Iterable[tuple[Unit, Measured]]:
    if executor is None:
        for unit in units:
            yield unit, _measure(unit)
        return
    futures = {executor.submit(_measure, unit): unit for unit in units}
    try:
        for future in as_completed(futures):
            yield futures[future], future.result()
    finally:
        for future in futures:
            future.cancel()


def _measure(unit: Unit) -> Measured:
    return measure(unit.world, unit.options, None, lambda *_: None)


def aggregate(summaries: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """VSS over maps, for each scenario that all of them have: the maps are the sample, their seeds nested.

    The interval is that of a mean over maps, each map's figure being the mean over its seeds.
    """
    by_scenario: dict[str, dict[str, list[tuple[float, float | None]]]] = {}
    for summary in summaries:
        for scenario in summary["scenarios"]:
            vss = scenario["vss"]
            by_scenario.setdefault(scenario["name"], {}).setdefault(summary["world"], []).append(
                (vss["executed"]["mean"], vss["executed_pct"]))
    rows = []
    for name, maps in by_scenario.items():
        vss = [float(np.mean([mean for mean, _ in figures])) for figures in maps.values()]
        shares = [[pct for _, pct in figures if pct is not None] for figures in maps.values()]
        rows.append({"scenario": name, "maps": len(maps), "vss": _over_maps(vss),
                     "vss_pct": _over_maps([float(np.mean(pct)) for pct in shares if pct])})
    return rows


def _over_maps(figures: Sequence[float]) -> dict[str, Any]:
    if not figures:
        return {"mean": None, "ci95": None}
    mean, n = float(np.mean(figures)), len(figures)
    if n < 2:
        return {"mean": mean + 0.0, "ci95": None}
    half = float(student_t.ppf(0.5 + CONFIDENCE / 2, n - 1)) * float(np.std(figures, ddof=1)) / n**0.5
    return {"mean": mean + 0.0, "ci95": [mean - half, mean + half]}
