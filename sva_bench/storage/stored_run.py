"""A finished run, read from its folder; validated, since the folder may be of any origin."""

from __future__ import annotations

import contextlib
import csv
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from sva_bench.analysis.calibration_table import CALIBRATION_COLUMNS, calibration_rows
from sva_bench.analysis.catalogue import csv_cells, csv_columns
from sva_bench.analysis.meetings import INTERACTION_COLUMNS, interaction_rows
from sva_bench.analysis.over_maps import BATCH, BatchSummary
from sva_bench.analysis.reaction_table import reaction_columns, reaction_rows
from sva_bench.analysis.results import SUMMARY, SUMMARY_OF_REACTIONS
from sva_bench.analysis.scenarios import ComparedScenario, ScenarioSummary
from sva_bench.analysis.summaries import AnySummary, ComparisonSummary, summary_form
from sva_bench.arrays import FloatArray, IntArray
from sva_bench.choices import ENDS, NEWS, POLICY_NAMES
from sva_bench.errors import BadFile, BadInput
from sva_bench.files.atomic import draft_file
from sva_bench.files.documents import Document, read_json, validate
from sva_bench.files.printable import counted
from sva_bench.files.read_back import MOST_BYTES, Part, read_ours
from sva_bench.mission.plan import Route
from sva_bench.mission.plan_file import read_routes
from sva_bench.storage.agreement import Claim, Key, check_outcomes, check_routes
from sva_bench.storage.leg_paths import LegPaths, read_paths
from sva_bench.storage.manifest import MANIFEST, Manifest
from sva_bench.storage.met_tables import FILES as MET_FILES
from sva_bench.storage.met_tables import read_met
from sva_bench.storage.run_folder import MAP, Legs, made_for, recording_stem, stem_of
from sva_bench.storage.tables import CONTACTS, LEGS, OUTCOMES, TRAVEL_TIMES, WAITS, pieces_of
from sva_bench.storage.tables import write_csv as write_table_as_csv
from sva_bench.storage.trial_counts import Counting, TrialCounts
from sva_bench.world.load import world_of
from sva_bench.world.model import World

MOST_LEGS = 5_000_000
"""Most legs of a report, which are held in memory."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Content:
    """The content of a report, all from the run folder.

    Attributes:
        summary: The summary.
        routes: Route of each robot, by scenario and planner; of a plan made for a reaction, by what ``made_for``
            calls it.
        stems: Names of a plan's files, by scenario and planner.
        reaction_stems: Names of the recordings of teams that react, by scenario, planner, policy and news.
        legs: The legs that were driven.
        world: The world, for its picture.
        manifest: What was run.
        lacking: Files of the run folder that are missing, and that the report can do without.
        contacts, waits: What robots met on the legs: the rows of these tables, none where there are none.
        paths: Planned paths of legs; none of older run folders.
        counts: How trials came out, counted.
    """

    summary: AnySummary
    routes: Mapping[tuple[str, str], Mapping[str, Sequence[str]]]
    stems: Mapping[tuple[str, str], str]
    legs: Legs
    world: World
    manifest: Manifest
    lacking: tuple[str, ...] = ()
    reaction_stems: Mapping[Key, str] = field(default_factory=dict)
    contacts: pa.Table = field(default_factory=CONTACTS.empty_table)
    waits: pa.Table = field(default_factory=WAITS.empty_table)
    paths: LegPaths = field(default_factory=dict)
    counts: TrialCounts = field(default_factory=TrialCounts)


def run_folder_at(path: Path) -> Path:
    """The path, if it is a run folder.

    Raises:
        BadInput: If it is none, with what it is.
        BadFile: If it lacks its summary.
    """
    if not path.exists():
        raise BadInput(f"{path}: no such folder; name a run folder, as in runs/<world>-seed0-<hash>")
    if not path.is_dir():
        raise BadInput(f"{path}: no folder; name a run folder, as in runs/<world>-seed0-<hash>")
    if is_batch(path):
        raise BadInput(f"{path}: the folder of a batch, not of a run; its own report.html shows it, and 'sva-bench "
                       "batch status' with this folder says how far it is")
    if _is_draft(path):
        raise BadInput(f"{path}: a run that was not finished; run its command again")
    if not (path / "summary.json").exists() and (path / "outcomes.parquet").exists():
        raise missing(path, path / "summary.json")
    if not (path / "summary.json").is_file():
        raise BadInput(f"{path}: {_no_run(path)}")
    return path


def _no_run(path: Path) -> str:
    """What a folder is that isn't a run's, and what to name instead."""
    runs = sorted(((entry / "summary.json").stat().st_mtime, entry) for entry in path.iterdir()
                  if (entry / "summary.json").is_file() and not is_batch(entry) and not _is_draft(entry))
    if runs:
        return f"holds {counted(len(runs), 'run')}, and is none itself; name one of them; the newest is {runs[-1][1]}"
    return "no run folder of ours (summary.json is missing); name one as in runs/<world>-seed0-<hash>"


def _is_draft(path: Path) -> bool:
    return path.name.startswith(".") and path.suffix == ".tmp"


@contextlib.contextmanager
def _complete(folder: Path) -> Iterator[None]:
    """A block in which missing files of a run folder are reported with what to do."""
    try:
        yield
    except BadFile as error:
        if Path(error.path).is_relative_to(folder) and not Path(error.path).exists():
            raise missing(folder, Path(error.path)) from None
        raise


def missing(folder: Path, path: Path) -> BadFile:
    """The error of a run folder in which a file is missing."""
    where = ", it stands in manifest.json" if (folder / "manifest.json").exists() else ""
    return BadFile(folder, None, "", f"the run folder is incomplete: {path.relative_to(folder)} is missing; run its "
                   f"command again{where}")


def is_batch(folder: Path) -> bool:
    """Whether a folder is that of a batch, complete or not."""
    try:
        data = read_json(folder / "manifest.json", MOST_BYTES).data
    except BadFile:
        return next(folder.glob("outcomes-*.parquet"), None) is not None
    return isinstance(data, dict) and str(data.get("format", "")).startswith("sva-bench/batch-manifest@")


def write_csv(folder: Path) -> list[Path]:
    """Write each table of a run folder, and the statistics of its plans and reactions, as CSV: the files written.

    Raises:
        BadFile: If one can't be read.
        BadInput: If one can't be written.
    """
    written = []
    met = [(name, schema) for name, schema in MET_FILES.items() if (folder / f"{name}.parquet").exists()]
    for name, schema in (("legs", LEGS), ("outcomes", OUTCOMES), ("travel_times", TRAVEL_TIMES), *met):
        path = folder / f"{name}.csv"
        with draft_file(path) as draft, _complete(folder):
            write_table_as_csv(folder / f"{name}.parquet", draft, schema)
        written.append(path)
    _, summary = _summary_in(folder)
    plans = [[scenario.name, name, *csv_cells(plan)]
             for scenario in summary.scenarios for name, plan in scenario.plans.items()]
    written.append(_write_rows(folder / "statistics.csv", ["scenario", "planner", *csv_columns()], plans))
    if curves := calibration_rows(summary.scenarios):
        written.append(_write_rows(folder / "calibration.csv", CALIBRATION_COLUMNS, curves))
    if reactions := reaction_rows(summary):
        written.append(_write_rows(folder / "reactions.csv", reaction_columns(summary), reactions))
    if met_others := [row for scenario in summary.scenarios for policy, news, held in (
            ("none", "never", scenario.plans), *((r.policy, r.news, r.plans) for r in scenario.reactions or ()))
            for row in interaction_rows(scenario.name, policy, news, held)]:
        written.append(_write_rows(folder / "interaction.csv", INTERACTION_COLUMNS, met_others))
    return written


def _write_rows(path: Path, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> Path:
    with draft_file(path) as draft, draft.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(columns)
        table.writerows(rows)
    return path


def _summary_in(folder: Path) -> tuple[Document, AnySummary]:
    """The summary of a run folder, as read and as checked."""
    document = read_json(folder / "summary.json", MOST_BYTES)
    grown = isinstance(document.data, dict) and document.data.get("format") == SUMMARY_OF_REACTIONS
    return document, validate(document, summary_form(document.data), SUMMARY_OF_REACTIONS if grown else SUMMARY)


def read_summary(folder: Path) -> AnySummary:
    """The summary of a run.

    Raises:
        BadFile: If it is missing or invalid.
        BadInput: If this is no run folder.
    """
    with _complete(folder):
        return _summary_in(run_folder_at(folder))[1]


def read_any_summary(folder: Path) -> dict[str, Any]:
    """The content of ``summary.json`` of a run or a batch, checked.

    Raises:
        BadFile: If it is missing, invalid, or of a batch that isn't done.
        BadInput: If this is no such folder.
    """
    if folder.is_dir() and is_batch(folder):
        path = folder / "summary.json"
        if not path.exists():
            raise BadFile(folder, None, "", "the batch is not done, it has no summary yet; go on with it with --resume")
        document: Document = read_ours(path, BatchSummary, BATCH)[0]
    else:
        with _complete(folder):
            document, _ = _summary_in(run_folder_at(folder))
    content: dict[str, Any] = document.data
    return content


def read_content(folder: Path) -> Content:
    """The content of the report of a run folder.

    Raises:
        BadFile: If a file is missing, truncated, invalid or not of the same run.
    """
    with _complete(folder):
        return _content(folder)


def _content(folder: Path) -> Content:
    document, summary = _summary_in(folder)
    manifest_document, manifest = read_ours(folder / "manifest.json", Manifest, MANIFEST)
    world = world_of(Part(manifest_document, ("world",), manifest.world), folder / MAP)
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
    claims = _claims(summary, world)
    words = {"scenario": frozenset(s.name for s in summary.scenarios), "planner": frozenset(key[1] for key in claims),
             "robot": frozenset(first.availability), "end": frozenset(ENDS), "policy": frozenset(POLICY_NAMES),
             "news": frozenset(NEWS), "fidelity": frozenset((summary.fidelity,))}
    counting = Counting(len(world.robots))
    driven = check_outcomes(folder / "outcomes.parquet", claims,
                            {robot.name: robot.loss_cost for robot in world.robots}, words, counting.add)
    pa.default_memory_pool().release_unused()  # else what the rows took stays with the process, beside the page
    foreign = isinstance(summary, ComparisonSummary)
    stems = {(scenario, name): stem_of(scenario, name, foreign=foreign)
             for scenario, name, policy, _ in claims if policy == "none"}
    files = {key: (key[0], key[1] if key[:2] in stems else made_for(key[1], key[3])) for key in claims}
    routes = _routes(folder, world, {plan: stem_of(*plan, foreign=foreign) for plan in [*stems, *files.values()]})
    legs = _legs(folder / "legs.parquet", world, words)
    paths = {key: folder / "plans" / f"{stem_of(*plan, foreign=foreign)}.json" for key, plan in files.items()
             if foreign or key[1] != "informed"}
    check_routes(paths, {key: routes[plan] for key, plan in files.items()}, legs, driven)
    told: dict[Key, str] = {
        (s.name, name, r.policy, r.news): recording_stem((s.name, name, r.policy, r.news), foreign=foreign)
        for s in summary.scenarios for r in s.reactions or () for name, plan in r.plans.items() if plan.reacted > 0}
    contacts, waits = read_met(folder, world, legs, words)
    return Content(summary=summary, routes=routes, stems=stems, manifest=manifest, world=world, legs=legs,
                   reaction_stems=told, contacts=contacts, waits=waits, paths=read_paths(folder, world),
                   counts=counting.result(), lacking=_lacking(
                       folder, [scenario.name for scenario in world.scenarios], dict.fromkeys([
                           *(f"{stem}.rrd" for stem in [*stems.values(), *told.values()]),
                           *(note.file for note in manifest.recordings)])))


def _claims(summary: AnySummary, world: World) -> dict[Key, Claim]:
    """What a summary says of the rows of each plan, without reaction and with each."""
    claims: dict[Key, Claim] = {}
    scenarios: Sequence[ScenarioSummary | ComparedScenario] = summary.scenarios
    for told, scenario in zip(scenarios, world.scenarios, strict=True):
        for name, plan in told.plans.items():
            claims[told.name, name, "none", "never"] = Claim(mean=plan.executed.mean, trials=summary.trials)
        # The first history is that without failures, but for those that are certain.
        safe = scenario.joint is None and all(told.availability.values())
        for reaction in told.reactions or ():
            all_of_them = reaction.histories == "enumerated"
            for name, reacting in reaction.plans.items():
                claims[told.name, name, reaction.policy, reaction.news] = Claim(
                    mean=reacting.executed.mean, trials=None if all_of_them else summary.trials,
                    begins_whole=all_of_them and safe)
    return claims


def find_row(path: Path, key: Key, trial: int) -> tuple[int, int] | None:
    """Noise draw and history of one trial of outcomes; ``None`` where there is no such trial.

    Raises:
        BadFile: If they can't be read.
    """
    for piece in _rows_of(path, key):
        found = piece.filter(pc.equal(piece.column("trial"), trial))
        if found.num_rows:
            return int(found.column("rollout")[0].as_py()), int(found.column("history")[0].as_py())
    return None


def rows_of_trial(path: Path, key: Key, trial: int) -> list[dict[str, Any]]:
    """The rows of one trial of outcomes, robot by robot.

    Raises:
        BadFile: If they can't be read.
    """
    return [row for piece in _rows_of(path, key)
            for row in piece.filter(pc.equal(piece.column("trial"), trial)).cast(OUTCOMES).to_pylist()]


def last_trial(path: Path, key: Key) -> int:
    """The greatest number of a trial of outcomes; -1 where there is none.

    Raises:
        BadFile: If they can't be read.
    """
    return max((pc.max(piece.column("trial")).as_py() for piece in _rows_of(path, key) if piece.num_rows), default=-1)


def values_of_trials(path: Path, key: Key) -> tuple[IntArray, FloatArray, FloatArray]:
    """Numbers of all trials of one plan and reaction, ascending; the value of each, all robots together; its weight.

    Raises:
        BadFile: If they can't be read.
    """
    pieces = [piece.select(["trial", "value", "weight"]) for piece in _rows_of(path, key)]
    # One thread: sums in another order could differ in their last bit, and trials of equal value with them.
    rows = pa.concat_tables(pieces).group_by("trial", use_threads=False).aggregate(
        [("value", "sum"), ("weight", "min")]).sort_by("trial")
    return (rows["trial"].to_numpy().astype(np.int64), rows["value_sum"].to_numpy(), rows["weight_min"].to_numpy())


def _rows_of(path: Path, key: Key) -> Iterator[pa.Table]:
    """The rows of one plan and reaction, piece by piece."""
    for piece in pieces_of(path, OUTCOMES):
        mask = pc.equal(pc.cast(piece.column("scenario"), pa.string()), key[0])
        for column, word in zip(("planner", "policy", "news"), key[1:], strict=True):
            mask = pc.and_(mask, pc.equal(pc.cast(piece.column(column), pa.string()), word))
        yield piece.filter(mask)


def _lacking(folder: Path, scenarios: Iterable[str], recordings: Iterable[str]) -> tuple[str, ...]:
    """The files of a run folder that aren't there and that no page rests on, relative to it."""
    expected = ["travel_times.parquet", *(f"instance-{name}.json" for name in scenarios)]
    # Looked up among those that are there: a manifest from elsewhere may name anything, and paths to other folders.
    held = {path.name for path in (folder / "recordings").glob("*.rrd")}
    return (*(name for name in expected if not (folder / name).is_file()),
            *(f"recordings/{name}" for name in recordings if name not in held))


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:5])[:200] + (" ..." if len(names) > 5 else "")


def _routes(folder: Path, world: World, stems: Mapping[tuple[str, str], str]
            ) -> dict[tuple[str, str], Mapping[str, Route]]:
    robots, sites = [robot.name for robot in world.robots], [site.name for site in world.sites]
    return {key: read_routes(folder / "plans" / f"{stem}.json", robots, sites) for key, stem in stems.items()}


def _legs(path: Path, world: World, words: Mapping[str, frozenset[str]]) -> Legs:
    sites = frozenset(site.name for site in world.sites)
    known = {**words, "origin": sites, "destination": sites}
    parts: dict[str, list[Any]] = {name: [] for name in LEGS.names}
    for piece in pieces_of(path, LEGS, most=MOST_LEGS, words=known):
        for name in ("planned_s", "driven_s"):
            ends = pc.min_max(piece.column(name)).as_py()
            if piece.num_rows and not 0 <= ends["min"] <= ends["max"] < 1e9:
                raise BadFile(path, None, name, "expected times between 0 and 1e9 s; run the command in manifest.json "
                              "again")
        for name in LEGS.names:
            parts[name].append(_as_column(piece.column(name)))
    columns: dict[str, Any] = {
        name: np.concatenate(found or [np.zeros(0)]) if name.endswith("_s") else [x for part in found for x in part]
        for name, found in parts.items()}
    return Legs(**columns)


def _as_column(column: pa.ChunkedArray) -> Any:
    """Floats as an array; strings and counts as a list, in which equal strings are one object."""
    if pa.types.is_floating(column.type):
        return column.to_numpy()
    if not pa.types.is_dictionary(column.type):
        return column.to_pylist()
    found: list[str] = []
    for chunk in column.chunks:
        words = chunk.dictionary.to_pylist()
        found += [words[k] for k in chunk.indices.to_pylist()]
    return found
