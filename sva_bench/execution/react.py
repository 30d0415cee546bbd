"""Plans executed by teams that react: every history of failures played, or a sample of them.

A policy decides on planned times as long as nothing was driven; the legs that its team then uses are driven, and the
missions are played again, until no leg is new.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from sva_bench.choices import News
from sva_bench.errors import BadInput
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.drives import Courses, Drives, drive_all
from sva_bench.execution.known_legs import KnownLegs, longest
from sva_bench.execution.orders import orders_of, planned_legs
from sva_bench.execution.plays import Enumerated, Rows, Sampled
from sva_bench.execution.policies.none import none
from sva_bench.execution.policies.policy import Policy
from sva_bench.execution.reacted import Reacted as Reacted
from sva_bench.execution.reacted import missions_of
from sva_bench.execution.shared.react import react_team, react_team_again
from sva_bench.execution.team import Team
from sva_bench.execution.team_trace import Played, legs_used, trace_teams, typical
from sva_bench.execution.whole import WholeDrives
from sva_bench.files.printable import counted
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.model import World

MOST_TRIALS_HELD = 20_000_000
"""Robots' missions of all cases that are sampled, at some 150 bytes each."""


def react(
    world: World, costs: Mapping[str, FuelCosts], cases: Sequence[Case], policies: Sequence[Policy], settings: Settings,
    executor: Executor | None = None, progress: Callable[[int, int], None] | None = None, drives: Drives | None = None,
) -> list[Reacted]:
    """Execute plans whose teams react, all histories or all trials of each.

    Histories are enumerated for all cases or for none, so that they can be compared; for none where robots meet.
    Missions are played again only as long as legs of them are unknown.

    Args:
        world: The world.
        costs: Fuel costs by the name of the robot model.
        cases: Plans with their scenario, policy and news.
        policies: The policy of each case.
        settings: Seed, trials, rollouts, fidelity.
        executor: Where drives run; ``None`` = here.
        progress: Called with the number of drives done and of all.
        drives: What was driven already; what is driven now is added.

    Raises:
        BadInput: If there are more trials to be sampled than fit in memory.
    """
    drives = Drives() if drives is None else drives
    legs = KnownLegs(world, costs, settings)
    teams = [_team(world, costs, case, policy, legs) for case, policy in zip(cases, policies, strict=True)]
    if world.meets:
        _refuse_beyond(world, len(cases), settings)
        return react_team(world, costs, [Sampled(world, case, team, settings) for case, team in zip(
            cases, teams, strict=True)], settings, legs, executor, progress, drives.missions)
    plays = _plays(world, cases, teams, settings, legs)
    rows = _driven(plays, legs, Courses(world, costs, settings), executor, progress, drives)
    reacted = [each.reacted(mine) for each, mine in zip(plays, rows, strict=True)]
    if not settings.recorded:
        return reacted
    if settings.fidelity == "rollout":
        reacted = _driven_whole(reacted, teams, WholeDrives(world, costs, settings, executor))
    return _recorded(world, costs, settings, reacted, legs, executor, drives)


def react_again(
    world: World, costs: Mapping[str, FuelCosts], case: Case, policy: Policy, settings: Settings, trial: int,
    history: tuple[int, int] | None, executor: Executor | None = None,
) -> Reacted:
    """One row of what ``react`` gave for a case, played again, and over time.

    Args:
        world, costs, case, policy, settings: As for ``react``.
        trial: Number of the row.
        history: Its noise draw and the number of its history there; ``None`` = it was sampled.
        executor: Where drives run; ``None`` = here.

    Raises:
        IndexError: If there is no such history.
    """
    legs = KnownLegs(world, costs, settings)
    team = _team(world, costs, case, policy, legs)
    if world.meets:
        alone = replace(settings, first=trial, trials=1)
        return react_team_again(world, costs, Sampled(world, case, team, alone), alone, legs, executor)
    play_again: Enumerated | Sampled
    if history is None:
        play_again = Sampled(world, case, team, replace(settings, first=trial, trials=1))
    else:
        play_again = Enumerated(world, case, team, settings, [history[0]])
    play_again.begin(legs)
    drives = Drives()
    (rows,) = _driven([play_again], legs, Courses(world, costs, settings), executor, None, drives)
    row = replace(play_again.reacted(rows).row(0 if history is None else history[1]), trial=np.array([trial]))
    (mission,) = missions_of(row)
    (shown,) = trace_teams(world, costs, settings, [mission], executor, drives)
    return replace(row, legs=tuple(legs_used(row.robots, [mission], legs)), shown=shown)


def _driven(
    plays: Sequence[Enumerated | Sampled], legs: KnownLegs, courses: Courses, executor: Executor | None,
    progress: Callable[[int, int], None] | None, drives: Drives,
) -> list[Rows]:
    """All rows of some plays, once each leg in them was driven."""
    for each in plays:
        each.want(legs)
    rows: list[Rows] = []
    while legs.missing or not rows:
        wanted, legs.missing = longest(legs.missing), {}
        drive_all(courses.chunks(wanted, drives), drives, executor, progress)
        courses.compose(wanted, drives)
        legs.learn(wanted, drives)
        rows = [each.rows(legs) for each in plays]
    return rows


def _recorded(
    world: World, costs: Mapping[str, FuelCosts], settings: Settings, reacted: Sequence[Reacted], legs: KnownLegs,
    executor: Executor | None, drives: Drives,
) -> list[Reacted]:
    """What came of cases, with the legs driven, and with a typical mission over time where one reacts."""
    missions = [missions_of(run) for run in reacted]
    chosen = [typical(mine) for mine in missions]
    traced = iter(trace_teams(world, costs, settings, [one for one in chosen if one is not None], executor, drives))
    return [replace(run, legs=tuple(legs_used(run.robots, mine, legs)), shown=None if one is None else next(traced))
            for run, mine, one in zip(reacted, missions, chosen, strict=True)]


def _driven_whole(reacted: Sequence[Reacted], teams: Sequence[Team], drives: WholeDrives) -> list[Reacted]:
    """Drive the most probable mission with changed orders under each policy and news whole, and compare."""
    chosen: dict[tuple[str, str], tuple[int, Played]] = {}
    for number, run in enumerate(reacted):
        mission, pair = typical(missions_of(run)), (run.case.policy, run.case.news)
        if mission is not None and (pair not in chosen or mission.weight > chosen[pair][1].weight):
            chosen[pair] = number, mission
    alike = {number: drives.ends_alike(teams[number], mission.outcome, mission.rollout)
             for number, mission in chosen.values()}
    return [replace(run, whole=alike.get(number)) for number, run in enumerate(reacted)]


def modelled_values(
    world: World, costs: Mapping[str, FuelCosts], cases: Sequence[Case], policies: Sequence[Policy], settings: Settings,
) -> list[float]:
    """Mean value of each case if every leg is driven as planned: over all histories if they are few, or over trials."""
    legs = KnownLegs(world, costs, settings)
    teams = [_team(world, costs, case, policy, legs) for case, policy in zip(cases, policies, strict=True)]
    return [each.modelled for each in _plays(world, cases, teams, settings, legs)]


def _plays(
    world: World, cases: Sequence[Case], teams: Sequence[Team], settings: Settings, legs: KnownLegs
) -> Sequence[Enumerated | Sampled]:
    """Cases played on planned times: all histories of each, or all trials of each."""
    enumerated = [Enumerated(world, case, team, settings) for case, team in zip(cases, teams, strict=True)]
    if all(each.begin(legs) for each in enumerated):
        return enumerated
    _refuse_beyond(world, len(cases), settings)
    sampled = [Sampled(world, case, team, settings) for case, team in zip(cases, teams, strict=True)]
    for each in sampled:
        each.begin(legs)
    return sampled


def refuse_beyond_memory(
    world: World, costs: Mapping[str, FuelCosts], cases: Sequence[Case], news: Sequence[News], runs: int,
    settings: Settings,
) -> None:
    """Refuse more trials than ``react`` can hold, where that is sure before anything is driven or decided.

    It is where the histories of teams that keep their orders are too many to be enumerated: theirs are gone through in
    any case.

    Args:
        world, costs: The world and its fuel costs.
        cases: Plans with their scenario.
        news: When teams learn of failures.
        runs: With how many cases ``react`` will be called, at least.
        settings: Trials, rollouts.

    Raises:
        BadInput: If there are more.
    """
    if _most_held(world, runs) >= settings.trials:
        return
    legs = KnownLegs(world, costs, settings)
    told = [replace(case, news=heard) for case in cases for heard in ("never", *news)]
    if world.meets or not all(
            Enumerated(world, case, _team(world, costs, case, none, legs), settings).begin(legs) for case in told):
        _refuse_beyond(world, runs, settings)


def _most_held(world: World, runs: int) -> int:
    """Most trials of so many cases that fit in memory."""
    return MOST_TRIALS_HELD // (len(world.robots) * runs)


def _refuse_beyond(world: World, runs: int, settings: Settings) -> None:
    """Refuse more sampled trials than fit in memory."""
    trials, most = settings.trials, _most_held(world, runs)
    if most < trials:
        why = f"the histories of {world.name} are not gone through, for its robots meet" if world.meets else \
            f"the histories of {world.name} are too many to go through all"
        raise BadInput(f"{counted(trials, 'trial')} of {counted(runs, 'plan')} with and without reaction: {why}, and "
                       f"at most {counted(most, 'trial')} can be sampled (--trials), or more of fewer reactions "
                       "(--policy, --news)")


def _team(world: World, costs: Mapping[str, FuelCosts], case: Case, policy: Policy, legs: KnownLegs) -> Team:
    return Team(orders=tuple(orders_of(world, case, planned_legs(world, costs, [case]))), base=world.sites[0].name,
                pois=frozenset(site.name for site in world.pois), policy=policy, news=case.news,
                scheduled_s=legs.scheduled_s)
