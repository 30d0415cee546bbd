"""A finished run, read again from its folder: checked as what comes from elsewhere is, for it may."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from sva_bench.choices import ENDS, NEWS, POLICY_NAMES
from sva_bench.errors import BadFile, BadInput
from sva_bench.files.atomic import draft_file
from sva_bench.files.documents import read_json
from sva_bench.files.read_back import MOST_BYTES, Part, read_ours
from sva_bench.mission.plan import Route
from sva_bench.mission.plan_file import read_routes
from sva_bench.storage.results_schema import ManifestFile, SummaryFile
from sva_bench.storage.run_folder import LEG_COLUMNS, MAP, stem_of
from sva_bench.storage.tables import LEGS, OUTCOMES, TRAVEL_TIMES, pieces_of
from sva_bench.storage.tables import write_csv as write_table_as_csv
from sva_bench.world.load import world_of
from sva_bench.world.model import World

_AGREE = 1e-6  # relative; a mean added up in another order
MOST_LEGS = 5_000_000
"""Legs that a report is made of; they are held in memory."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Content:
    """What a report is made of: all of it stands in the run folder.

    Attributes:
        summary: Content of ``summary.json``.
        routes: Route of each robot, by scenario and planner.
        stems: Names of a plan's files, by scenario and planner.
        legs: Columns of ``legs.parquet``.
        world: The world, for its picture.
        manifest: Content of ``manifest.json``.
    """

    summary: Mapping[str, Any]
    routes: Mapping[tuple[str, str], Mapping[str, Sequence[str]]]
    stems: Mapping[tuple[str, str], str]
    legs: Mapping[str, Sequence[Any]]
    world: World
    manifest: Mapping[str, Any]


def run_folder_at(path: Path) -> Path:
    """The path, if it is a run folder.

    Raises:
        BadInput: If it is none: says what it is.
    """
    if not path.exists():
        raise BadInput(f"{path}: no such folder; name a run folder, as in runs/<world>-seed0-<hash>")
    if not path.is_dir():
        raise BadInput(f"{path}: no folder; name a run folder, as in runs/<world>-seed0-<hash>")
    if is_batch(path):
        raise BadInput(f"{path}: the folder of a batch, not of a run; its own report.html shows it, and 'sva-bench "
                       "batch status' with this folder says how far it is")
    if path.name.startswith(".") and path.suffix == ".tmp":
        raise BadInput(f"{path}: a run that was not finished; run its command again")
    if not (path / "summary.json").is_file():
        within = [entry for entry in sorted(path.iterdir()) if (entry / "summary.json").is_file()]
        hint = f"name one of the folders in it, such as {within[0]}" if within else \
            "name one as in runs/<world>-seed0-<hash>"
        raise BadInput(f"{path}: no run folder of ours (summary.json is missing); {hint}")
    return path


def is_batch(folder: Path) -> bool:
    """Whether a folder is that of a batch, whole or not."""
    try:
        data = read_json(folder / "manifest.json", MOST_BYTES).data
    except BadFile:
        return next(folder.glob("outcomes-*.parquet"), None) is not None
    return isinstance(data, dict) and str(data.get("format", "")).startswith("sva-bench/batch-manifest@")


def write_csv(folder: Path) -> list[Path]:
    """Write each table of a run folder as CSV too, for spreadsheets.

    Raises:
        BadFile: If one can't be read.
        BadInput: If one can't be written.
    """
    written = []
    for name, schema in (("legs", LEGS), ("outcomes", OUTCOMES), ("travel_times", TRAVEL_TIMES)):
        path = folder / f"{name}.csv"
        with draft_file(path) as draft:
            write_table_as_csv(folder / f"{name}.parquet", draft, schema)
        written.append(path)
    return written


def read_content(folder: Path) -> Content:
    """What the report of a run folder is made of.

    Raises:
        BadFile: If a file is missing, cut off, foreign or not of the same run.
    """
    document, summary = read_ours(folder / "summary.json", SummaryFile, "sva-bench/summary@1")
    told, manifest = read_ours(folder / "manifest.json", ManifestFile, "sva-bench/manifest@1")
    world = world_of(Part(told, ("world",), manifest.world), folder / MAP)
    first = summary.scenarios[0]
    for key, found, known in (
            (("world",), [summary.world], [world.name]),
            (("seed",), [str(summary.seed)], [str(manifest.seed)]),
            (("scenarios", 0, "availability"), list(first.availability), [robot.name for robot in world.robots]),
            (("scenarios",), [s.name for s in summary.scenarios], [s.name for s in world.scenarios])):
        if found != known:
            raise document.error(key, f"not of the world in manifest.json: expected {_some(known)}, found "
                                 f"{_some(found)}")
    for number, (told_of, scenario) in enumerate(zip(summary.scenarios, world.scenarios, strict=True)):
        if told_of.availability != dict(scenario.availability):
            raise document.error(("scenarios", number, "availability"), "not that of the world in manifest.json")
    plans = {(s.name, name): plan.executed.mean for s in summary.scenarios for name, plan in s.plans.items()}
    words = {"scenario": frozenset(s.name for s in summary.scenarios), "planner": frozenset(first.plans),
             "robot": frozenset(first.availability), "end": frozenset(ENDS), "policy": frozenset(POLICY_NAMES),
             "news": frozenset(NEWS), "fidelity": frozenset((summary.fidelity,))}
    _check_outcomes(folder / "outcomes.parquet", plans, summary.trials, len(first.availability), words)
    foreign = "comparisons" in document.data["scenarios"][0]
    stems = {(scenario, name): stem_of(scenario, name, foreign=foreign) for scenario, name in plans}
    return Content(summary=document.data, routes=_routes(folder, world, stems), stems=stems, manifest=told.data,
                   world=world, legs=_legs(folder / "legs.parquet", world, words))


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:5])[:200] + (" ..." if len(names) > 5 else "")


def _routes(folder: Path, world: World, stems: Mapping[tuple[str, str], str]
            ) -> dict[tuple[str, str], Mapping[str, Route]]:
    robots, sites = [robot.name for robot in world.robots], [site.name for site in world.sites]
    return {key: read_routes(folder / "plans" / f"{stem}.json", robots, sites) for key, stem in stems.items()}


def _legs(path: Path, world: World, words: Mapping[str, frozenset[str]]) -> dict[str, Any]:
    sites = frozenset(site.name for site in world.sites)
    known = {**words, "origin": sites, "destination": sites}
    parts: dict[str, list[Any]] = {name: [] for name in LEG_COLUMNS}
    for piece in pieces_of(path, LEGS, most=MOST_LEGS, words=known):
        for name in ("planned_s", "driven_s"):
            ends = pc.min_max(piece.column(name)).as_py()
            if piece.num_rows and not 0 <= ends["min"] <= ends["max"] < 1e9:
                raise BadFile(path, None, name, "expected times between 0 and 1e9 s; run the command in manifest.json "
                              "again")
        for name in LEG_COLUMNS:
            parts[name].append(_plainly(piece.column(name)))
    return {name: np.concatenate(found) if name.endswith("_s") and found else [x for part in found for x in part]
            for name, found in parts.items()}


def _plainly(column: pa.ChunkedArray) -> Any:
    """Figures as an array; words and counts as a list whose equal words are one object."""
    if pa.types.is_floating(column.type):
        return column.to_numpy()
    if not pa.types.is_dictionary(column.type):
        return column.to_pylist()
    found: list[str] = []
    for chunk in column.chunks:
        words = chunk.dictionary.to_pylist()
        found += [words[k] for k in chunk.indices.to_pylist()]
    return found


def _check_outcomes(path: Path, plans: Mapping[tuple[str, str], float], trials: int, robots: int,
                    words: Mapping[str, frozenset[str]]) -> None:
    """Refuse outcomes that aren't a row for each trial and robot, or whose means aren't those of the summary."""
    sums, counts = dict.fromkeys(plans, 0.0), dict.fromkeys(plans, 0)
    for piece in pieces_of(path, OUTCOMES, rows=len(plans) * trials * robots, words=words):
        grouped = piece.group_by(["scenario", "planner"]).aggregate([("incentive", "sum"), ("trial", "count")])
        for row in grouped.to_pylist():
            key = row["scenario"], row["planner"]
            sums[key] += row["incentive_sum"]
            counts[key] += row["trial_count"]
    for (scenario, name), mean in plans.items():
        found = sums[scenario, name] / trials
        if counts[scenario, name] != trials * robots or not np.isclose(found, mean, rtol=_AGREE, atol=_AGREE):
            raise BadFile(path, None, "incentive", f"these aren't the trials of summary.json: {scenario}, {name} "
                          f"collected {mean:.6g} there and {found:.6g} here, in {counts[scenario, name] // robots} "
                          "trials; run the command in manifest.json again")
