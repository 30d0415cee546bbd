"""The recordings of a run folder, and what stands about them in its manifest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from sva_bench.choices import RecordedKind
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.outcome import Trace
from sva_bench.execution.reacted import Reacted
from sva_bench.execution.team_trace import TeamTrace
from sva_bench.recording.about import About
from sva_bench.recording.record import Side, record, record_pair
from sva_bench.storage.agreement import Key
from sva_bench.storage.manifest import RecordingNote
from sva_bench.storage.run_folder import pair_stem, recording_stem
from sva_bench.study.recordings import Recorded
from sva_bench.world.model import World


def write_recordings(
    folder: Path, world: World, recorded: Sequence[Recorded], reacted: Sequence[Reacted], settings: Settings,
    progress: Callable[[int, int], None], *, foreign: bool,
) -> tuple[dict[Key, str], tuple[RecordingNote, ...]]:
    """Write the recordings of a run.

    Args:
        folder: The run folder's ``recordings``.
        world, settings: What was executed, and how.
        recorded: Trials of plans.
        reacted: What came of the plans with each reaction.
        progress: Called with how many are written, and of how many.
        foreign: Whether the plans are from elsewhere.

    Returns:
        Names of the recordings of teams that react, and what all show.
    """
    notes: list[RecordingNote] = []
    told: dict[Key, str] = {}
    teams = [(run.case, run.shown) for run in reacted if run.shown is not None]
    pairs = pairs_of(recorded)
    count, of = 0, len(recorded) + len(teams) + len(pairs)

    def write(stem: str, case: Case, planners: Sequence[str], about: About, do: Callable[[Path], None]) -> None:
        nonlocal count
        do(folder / f"{stem}.rrd")
        notes.append(RecordingNote(file=f"{stem}.rrd", scenario=case.scenario.name, planners=tuple(planners),
                                   trial=about.trial, chosen=about.kind, policy=about.policy, news=about.news))
        count += 1
        progress(count, of)

    for one in recorded:
        which = {"typical": None, "first": None, "trial": one.trial}.get(one.kind, one.kind)
        about = about_of(one, settings)
        write(recording_stem(one.case.key, which, foreign=foreign), one.case, [one.case.planner], about,
              partial(record_trial, world=world, case=one.case, traces=one.traces, about=about))
    for one, other in pairs:
        sides = [Side(about=about_of(side, settings), traces=side.traces, routes=side.case.plan.routes)
                 for side in (one, other)]
        name = one.case.scenario.name
        write(pair_stem(name, foreign=foreign), one.case, [side.about.planner for side in sides], sides[0].about,
              partial(record_pair, world=world, sides=sides,
                      title=f"{world.name}, {name}, trial {one.trial}, compared"))
    for case, team in teams:
        told[case.key] = stem = recording_stem(case.key, foreign=foreign)
        write(stem, case, [case.planner], team_about(case, team, settings),
              partial(record_team, world=world, case=case, team=team, settings=settings))
    return told, tuple(notes)


def pairs_of(recorded: Sequence[Recorded]) -> list[tuple[Recorded, Recorded]]:
    """Of each scenario the first two plans that differ, in their typical trial: ours are those behind the VSS."""
    found = []
    for scenario in dict.fromkeys(one.case.scenario.name for one in recorded):
        mine = [one for one in recorded if one.case.scenario.name == scenario and one.kind == "typical"]
        other = next((one for one in mine[1:] if not one.case.plan.drives_like(mine[0].case.plan)), None)
        if other is not None:
            found.append((mine[0], other))
    return found


def about_of(one: Recorded, settings: Settings) -> About:
    """What the recording of a trial is of."""
    return About(scenario=one.case.scenario.name, planner=one.case.planner, trial=one.trial, seed=settings.seed,
                 fidelity=settings.fidelity, kind=one.kind)


def team_about(case: Case, team: TeamTrace, settings: Settings, kind: RecordedKind = "typical") -> About:
    """What the recording of a team that reacts is of."""
    return About(scenario=case.scenario.name, planner=case.planner, trial=team.trial, seed=settings.seed,
                 fidelity=settings.fidelity, kind=kind, policy=case.policy, news=case.news)


def record_trial(path: Path, world: World, case: Case, traces: Sequence[Trace], about: About) -> None:
    """Write the recording of a trial."""
    record(path, world, traces, title=f"{world.name}, {case.title}, trial {about.trial}", about=about,
           routes=case.plan.routes)


def record_team(path: Path, world: World, case: Case, team: TeamTrace, settings: Settings,
                kind: RecordedKind = "typical") -> None:
    """Write the recording of a mission in which a team reacts."""
    record(path, world, team.traces, news=team.news, title=f"{world.name}, {case.title}, trial {team.trial}",
           about=team_about(case, team, settings, kind), routes=case.plan.routes)
