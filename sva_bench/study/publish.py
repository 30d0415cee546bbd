"""Writing of run folders, and of their reports again."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from sva_bench.analysis.summaries import AnySummary
from sva_bench.execution.executed import Executed
from sva_bench.execution.reacted import Reacted
from sva_bench.files.atomic import draft_file
from sva_bench.mission.instance import Instance
from sva_bench.mission.instance_file import write_instance
from sva_bench.mission.plan_file import write_plan
from sva_bench.report.run_page import write_report
from sva_bench.storage.leg_paths import paths_of, write_paths
from sva_bench.storage.manifest import manifest_of
from sva_bench.storage.met_tables import contact_table, wait_table, write_met
from sva_bench.storage.run_folder import (
    legs_of,
    made_for,
    run_folder,
    run_name,
    stem_of,
    write_legs,
    write_map,
    write_outcomes,
    write_record,
    write_travel_times,
)
from sva_bench.storage.stored_run import Content, read_content, run_folder_at
from sva_bench.storage.trial_counts import Counting
from sva_bench.study.options import Options, identity_of, settings_of
from sva_bench.study.recordings import Recorded
from sva_bench.study.summing import by_case
from sva_bench.travel.fuel import FuelCosts
from sva_bench.workers.progress import OnProgress
from sva_bench.world.load import world_as_dict
from sva_bench.world.model import World

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False, kw_only=True)
class Run:
    """A finished run.

    Attributes:
        folder: Its folder.
        summary: Its summary.
        unused: Robots that every plan leaves at home.
    """

    folder: Path
    summary: AnySummary
    unused: tuple[str, ...] = ()


def publish(
    world: World, options: Options, costs: Mapping[str, FuelCosts], instances: Mapping[str, Instance],
    executed: Sequence[Executed], recorded: Sequence[Recorded], summary: AnySummary, out: Path, clock: Stopwatch,
    progress: OnProgress, identity: Mapping[str, Any] | None = None, command: Sequence[str] | None = None,
    reacted: Sequence[Reacted] = (),
) -> Run:
    """Write the run folder.

    Args:
        world, options, costs, instances, executed, summary: What was measured, and how.
        recorded: Trials that are recorded.
        out: The folder that receives the run folder.
        clock, progress: How long it took so far; told how far the recording is.
        identity: What results of plans from elsewhere depend on beside the rest.
        command: What was called; ``None`` = the command line of this process.
        reacted: What came of the plans with each reaction.
    """
    foreign = identity is not None
    resolved = world_as_dict(world)
    name = run_name(world.name, options.seed,
                    {"world": resolved, "options": identity_of(world, options), **_digests(world), **(identity or {})})
    stems = {key: stem_of(*key, foreign=foreign) for key in by_case(executed)}
    routes = {key: run.case.plan.routes for key, run in by_case(executed).items()}
    # The viewer's library takes memory, and no report needs it.
    from sva_bench.study.recording_files import write_recordings

    with run_folder(out, name) as folder:
        (folder / "plans").mkdir()
        (folder / "recordings").mkdir()
        write_map(folder, world.files)
        write_travel_times(folder / "travel_times.parquet", costs)
        for scenario, instance in instances.items():
            write_instance(folder / f"instance-{scenario}.json", instance)
        for done in executed:
            stem = stems[done.case.scenario.name, done.case.planner]
            write_plan(folder / "plans" / f"{stem}.json", done.case.plan)
        for team in reacted:
            if team.case.role == "anticipative":
                plan = team.case.scenario.name, made_for(team.case.planner, team.case.news)
                routes[plan] = team.case.plan.routes
                write_plan(folder / "plans" / f"{stem_of(*plan, foreign=foreign)}.json", team.case.plan)
        with clock.phase("recording"):
            told, notes = write_recordings(
                folder / "recordings", world, recorded, reacted, settings_of(world, options),
                lambda done, of: progress("recording", done, of), foreign=foreign)
        legs = legs_of([*executed, *reacted])
        write_legs(folder / "legs.parquet", legs)
        contacts, waits = contact_table([*executed, *reacted]), wait_table([*executed, *reacted])
        write_met(folder, contacts, waits)
        counting = Counting(len(world.robots))
        write_outcomes(folder / "outcomes.parquet", [*executed, *reacted], [r.name for r in world.robots],
                       settings_of(world, options), counting.add)
        paths = paths_of(world, costs, routes.values(), legs)
        write_paths(folder, paths)
        write_record(folder / "summary.json", summary)
        manifest = manifest_of(resolved, options.seed, options.as_dict(), clock.started, clock.seconds, command,
                               notes)
        write_record(folder / "manifest.json", manifest)
        write_report(folder / "report.html", Content(
            summary=summary, routes=routes, stems=stems, reaction_stems=told, legs=legs, world=world,
            manifest=manifest, contacts=contacts, waits=waits, paths=paths, counts=counting.result()))
    # Of perfect-information plans there is one for each set of robots: what is not in the first may be in another.
    informed = any(run.case.role == "informed" for run in executed)
    unused = [] if informed else [robot.name for robot in world.robots if not any(
        set(sites.get(robot.name, ())) - {world.sites[0].name} for sites in routes.values())]
    return Run(folder=out / name, summary=summary, unused=tuple(unused))


def report_again(folder: Path) -> Path:
    """Write the report of a finished run again, from its tables.

    Raises:
        BadInput, BadFile: If this is no run folder, or a file in it is truncated, invalid or not of the same run.
    """
    content = read_content(run_folder_at(folder))
    if content.lacking:
        _log.warning("%s: missing, but the report doesn't rest on them: %s", folder, ", ".join(content.lacking))
    path = folder / "report.html"
    with draft_file(path) as draft:
        write_report(draft, content)
    return path


def _digests(world: World) -> dict[str, Mapping[str, str]]:
    """Digests of the files that a world names, by name; nothing if it names none."""
    return {"files": world.digests()} if world.files else {}


class Stopwatch:
    """Wall-clock time of each phase, for the manifest alone."""

    def __init__(self) -> None:
        self.started = datetime.now(UTC).isoformat(timespec="seconds")
        self.seconds: dict[str, float] = {}

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        started_s = time.monotonic()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.monotonic() - started_s
