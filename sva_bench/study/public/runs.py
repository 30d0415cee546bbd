"""Missions executed, measured and recorded."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import cast

from sva_bench.analysis.calibration import Target, target_of
from sva_bench.analysis.precision import Precision, precision_of
from sva_bench.analysis.summaries import ComparisonSummary, Summary
from sva_bench.choices import NEWS, Departures, FailureProcess, Fidelity, Interaction, News, PathPlanner, PolicyName
from sva_bench.errors import BadInput, nearest
from sva_bench.files.outputs import check_folder, check_output
from sva_bench.mission.plan import Plan
from sva_bench.solver.two_stage import SolveLimits
from sva_bench.storage.run_folder import tidy
from sva_bench.study.bounds import MOST_ROLLOUTS, MOST_SEED, MOST_TRIALS
from sva_bench.study.compare import measure_plans, publish_plans
from sva_bench.study.costs import plan_costs
from sva_bench.study.given_plans import drivable, without_times
from sva_bench.study.inputs import about, by_name, folded, what_is_wrong_with
from sva_bench.study.libraries import PRELOAD
from sva_bench.study.options import Options, settings_of
from sva_bench.study.planning import check_plans
from sva_bench.study.public.arguments import (
    PathLike,
    WorldLike,
    called_from_python,
    choice,
    chosen,
    flag,
    integer,
    is_a,
    names_of,
    number,
    optional,
    path_of,
    progress_of,
    world_given,
)
from sva_bench.study.public.plans import plan_given
from sva_bench.study.public.results import Result
from sva_bench.study.reacting import check_reactions, news_of, policies_of, refuse_the_name
from sva_bench.study.recording_files import about_of, record_team, record_trial
from sva_bench.study.recordings import Recorded, asks_of
from sva_bench.study.run import measure, publish_run
from sva_bench.workers.pool import count_of, local_workers
from sva_bench.workers.progress import OnProgress
from sva_bench.world.model import World

PlanLike = Plan | str | os.PathLike[str]


@called_from_python()
def run(
    world: WorldLike, *, seed: int = 0, trials: int = Options.trials, rollouts: int = Options.rollouts,
    fidelity: Fidelity = "rollout", planner: PathPlanner = "prmstar", scenario: str | Sequence[str] | None = None,
    margin: float | None = None, plan_failure: FailureProcess | None = None,
    execute_failure: FailureProcess | None = None, policy: PolicyName | Sequence[PolicyName] | None = None,
    news: News | Sequence[News] | None = None, anticipate: bool = False, time_limit: float | None = None,
    gap: float = 1e-6, evpi: bool = False, informed: bool = False, assumptions: bool = False,
    calibrate: float | str | None = None, precision: float | str | None = None, anytime: bool = False,
    max_trials: int | None = None, interaction: Interaction | None = None, departures: Departures | None = None,
    record: str | Sequence[str] | None = None, out: PathLike | None = None, workers: int | None = None,
    progress: OnProgress | None = None,
) -> Result[Summary]:
    """Plan, execute and measure a mission, as ``sva-bench run`` does; nothing is written unless ``out`` says where.

    Args:
        world: The world, or its file.
        seed: Seed of failures and noise; plans don't depend on it.
        trials: Trials of each plan in each scenario.
        rollouts: Noise draws; trial t has number t mod ``rollouts``.
        fidelity: The twin alone (``kinematic``), physics once a noise draw (``rollout``), or each trial (``physics``).
        planner: OMPL planner of the paths.
        scenario: Only this scenario, or these; by default all.
        margin: Planning costs are twin times x (1 + margin), 0 to 1; by default the world's.
        plan_failure, execute_failure: Failure process that plans are made for, and that is executed; by default the
            world's.
        policy: What the team does about failures: nothing (``none``), or plan what is left again (``resolve``); of
            several, each is measured. By default the world's.
        news: When it learns of one: ``instant``, when the ``report`` from a robot's next stop is overdue, each robot
            at a ``station``, or ``never``; of several, each is measured. By default the world's, or ``report``.
        anticipate: With a policy: make a plan for the reaction too, the planner ``anticipative``.
        calibrate: Make the planner ``calibrated`` too: for at most so many per cent of missions that go wrong though
            nobody fails, 1 or ``"1%"``, or for the greatest executed value, ``"best"``.
        time_limit: Stop each solve after so many seconds and take its best plan; none by default.
        gap: Relative gap at which a plan counts as optimal.
        evpi: Work out the value of perfect information however long it takes.
        informed: Execute as well what somebody would plan who knew beforehand who is available.
        assumptions: Execute the plans made for each failure process under all of them.
        precision: Go on until the executed VSS is known to so many per cent of the stochastic mean: 1 or ``"1%"``.
        anytime, max_trials: With ``precision``: stop by intervals that hold at any stop; the most trials (100 000).
        interaction, departures: As in world files: ``shared`` and its like, ``together`` or ``staggered``.
        record: Trials to record beside typical ones, as in ``"S3:17"`` or ``"worst"``; with ``out``.
        out: Folder that receives the run folder.
        workers: Processes that drive; by default one a core. A script needs no guard of its main module for them.
        progress: Called with what is being done, how much of it is done, and how much there is.

    Returns:
        Summary, plans, and the outcomes and legs as Arrow tables; the same figures as those of the command.

    Raises:
        UnreachableSite, NeverArrives, NoRoomForBerths, NoRoomForSlots: If a robot of a ``World`` can't get from the
            base to a site, can't follow a path, or robots that meet don't fit about base or station; of a world's
            file, ``BadFile`` says so with the line.
        BadFile, BadInput: If something is wrong with the file, or with a value, or two don't go together.
        WorkerLost: If a worker process died.
        ValueError: If an argument is of a wrong type.
        KeyboardInterrupt: On Ctrl-C; nothing is left behind.
    """
    told, place = progress_of(progress), _place(out)
    options = _options(seed, trials, rollouts, fidelity, planner, Options(
        limits=SolveLimits(time_limit_s=optional(number, "time_limit", time_limit, 0), gap=number("gap", gap, 0)),
        evpi=flag("evpi", evpi), informed=flag("informed", informed), assumptions=flag("assumptions", assumptions),
        policies=policies_of(names_of("policy", policy) or ()), news=news_of(names_of("news", news) or ()),
        anticipate=flag("anticipate", anticipate), calibrate=_target(calibrate),
        precision=_precision(precision, max_trials, trials, rollouts, anytime=flag("anytime", anytime))))
    read, path = world_given(world, scenario, margin, _process("plan_failure", plan_failure),
                             _process("execute_failure", execute_failure), interaction, departures)
    options = _checked(options, record, read)
    with nullcontext() if path is None else about(path), local_workers(_workers(workers), PRELOAD) as executor:
        done = measure(read, options, executor, told)
        put = None if place is None else publish_run(read, options, done, place, told, _command(), executor)
    return Result(world=read, summary=done.summary, folder=put.folder if put else None,
                  settings=settings_of(read, options), executed=tuple(done.executed), reacted=tuple(done.reacted))


@called_from_python()
def execute(
    world: WorldLike, plans: PlanLike | Mapping[str, PlanLike] | Sequence[PathLike], *, allow_infeasible: bool = False,
    seed: int = 0, trials: int = Options.trials, rollouts: int = Options.rollouts, fidelity: Fidelity = "rollout",
    planner: PathPlanner = "prmstar", scenario: str | Sequence[str] | None = None, margin: float | None = None,
    execute_failure: FailureProcess | None = None, policy: PolicyName | Sequence[PolicyName] | None = None,
    news: News | Sequence[News] | None = None, anticipate: bool = False, interaction: Interaction | None = None,
    departures: Departures | None = None, record: str | Sequence[str] | None = None, out: PathLike | None = None,
    workers: int | None = None, progress: OnProgress | None = None,
) -> Result[ComparisonSummary]:
    """Execute plans from anywhere in a world and compare them pair by pair, as ``sva-bench execute`` does.

    Args:
        world: The world, or its file.
        plans: One plan, which goes by the name ``plan``; plans by their names; or plan files, which go by their stems.
        allow_infeasible: Drive plans that break fuel capacity or mission limit too; each is warned of.
        seed, trials, rollouts, fidelity, planner, scenario, margin, execute_failure, policy, news, anticipate: As for
            ``run``.
        interaction, departures, record, out, workers, progress: As for ``run``.

    Returns:
        Summary with the comparisons, and the outcomes and legs as Arrow tables.

    Raises:
        InfeasiblePlan: If a plan can't be driven; or breaks fuel or limit, and that isn't allowed.
        UnreachableSite: If a robot cannot get from the base to a site of a ``World``; of its file, ``BadFile`` says so
            with the line.
        NeverArrives: If the figures of a robot don't let it follow a path.
        NoRoomForBerths, NoRoomForSlots: If robots that meet don't fit about base or station; of a file as above.
        BadFile, BadInput: If something is wrong with a file, or with a value.
        WorkerLost: If a worker process died.
        ValueError: If an argument is of a wrong type.
        KeyboardInterrupt: On Ctrl-C; nothing is left behind.
    """
    told, place, count = progress_of(progress), _place(out), _workers(workers)
    options = _options(seed, trials, rollouts, fidelity, planner, Options(
        policies=policies_of(names_of("policy", policy) or ()), news=news_of(names_of("news", news) or ()),
        anticipate=flag("anticipate", anticipate)))
    allowed = flag("allow_infeasible", allow_infeasible)
    named = _named(plans)
    read, path = world_given(world, scenario, margin, None, _process("execute_failure", execute_failure), interaction,
                             departures)
    options = _checked(options, record, read)
    refuse_the_name(named, anticipate=options.anticipate)
    bare = without_times(read)
    labels: dict[str, Path | str] = {name: _label(plans, name, plan) for name, plan in named.items()}
    given = {name: drivable(read, bare, plan_given(str(labels[name]), plan, bare), labels[name])
             for name, plan in named.items()}
    with nullcontext() if path is None else about(path):
        costs = plan_costs(read, options.planner, told)
        check_plans(read, costs, given, labels, allow_infeasible=allowed)
        with local_workers(count, PRELOAD) as executor:
            done = measure_plans(read, given, options, executor, told, costs)
            folder = None if place is None else publish_plans(
                read, given, options, done, place, told, costs, _command(), executor).folder
    return Result(world=read, summary=done.summary, folder=folder, settings=settings_of(read, options),
                  executed=tuple(done.executed), reacted=tuple(done.reacted))


@called_from_python()
def record(
    result: Result[Summary] | Result[ComparisonSummary], path: PathLike, *, scenario: str | None = None,
    planner: str | None = None, policy: PolicyName = "none", news: News | None = None,
) -> Path:
    """Write the first trial of a plan, or a typical one in which the team reacts, for the Rerun viewer.

    Args:
        result: What ``run`` or ``execute`` gave.
        path: The ``.rrd`` file.
        scenario: The scenario; by default the first.
        planner: Whose plan, or the name it was given by; by default the first: ``stochastic`` after ``run``.
        policy: What the team does about failures; with one, the most probable course of events in which it changes
            orders is shown.
        news: When it learns of one; by default the first that was measured.

    Returns:
        The path.

    Raises:
        BadInput: If there is no such scenario, plan or reaction, orders never change, or the file can't be written.
        ValueError: If an argument is of a wrong type.
    """
    is_a("result", result, Result, "what run or execute gave")
    target = path_of("path", path)
    if target.suffix.lower() != ".rrd":
        raise BadInput(f"path: {target}: let the name of a recording end in .rrd")
    check_output(target, way_out="choose another path")
    plans = result.plans
    chosen_scenario = _one_of("scenario", scenario, list(plans))
    if choice("policy", policy, PolicyName) != "none":
        reacting = [run for run in result.reacted
                    if (run.case.scenario.name, run.case.policy) == (chosen_scenario, policy)]
        if not reacting:
            raise BadInput(f"policy {policy!r}: the result holds no such reaction; ask run or execute for it")
        heard = _one_of("news", news, list(dict.fromkeys(run.case.news for run in reacting)))
        mine = {run.case.planner: run for run in reacting if run.case.news == heard}
        chosen = mine[_one_of("planner", planner, list(mine))]
        if chosen.shown is None:
            raise BadInput(f"{chosen.case.title}: orders never change; record it without a policy")
        record_team(target, result.world, chosen.case, chosen.shown, result.settings)
        return target
    reacts = dict.fromkeys(run.case.policy for run in result.reacted
                           if (run.case.scenario.name, run.case.planner) == (chosen_scenario, planner))
    if planner not in plans[chosen_scenario] and reacts:
        raise BadInput(f"planner {planner!r}: this plan was made for a reaction; add policy={next(iter(reacts))!r}")
    name = _one_of("planner", planner, list(plans[chosen_scenario]))
    executed = next(run for run in result.executed
                    if (run.case.scenario.name, run.case.planner) == (chosen_scenario, name))
    first = Recorded(case=executed.case, trial=0, kind="first", traces=executed.traces)
    record_trial(target, result.world, executed.case, executed.traces, about_of(first, result.settings))
    return target


def _one_of(name: str, value: str | None, known: list[str]) -> str:
    if value is None:
        return known[0]
    if is_a(name, value, str, "a name") not in known and value in NEWS:
        raise BadInput(f"{name} {value!r}: not measured; the result has {', '.join(known)}")
    if value not in known:
        raise BadInput(f"{name} {value[:60]!r}: there is none of that name; {nearest(value, known)}")
    return value


def _options(
    seed: int, trials: int, rollouts: int, fidelity: Fidelity, planner: PathPlanner, rest: Options,
) -> Options:
    return Options(
        seed=integer("seed", seed, 0, MOST_SEED), trials=integer("trials", trials, 1, MOST_TRIALS),
        rollouts=integer("rollouts", rollouts, 1, MOST_ROLLOUTS), fidelity=choice("fidelity", fidelity, Fidelity),
        planner=choice("planner", planner, PathPlanner), limits=rest.limits, evpi=rest.evpi, informed=rest.informed,
        assumptions=rest.assumptions, policies=rest.policies, news=rest.news, anticipate=rest.anticipate,
        calibrate=rest.calibrate, precision=rest.precision)


def _checked(options: Options, record: str | Sequence[str] | None, world: World) -> Options:
    """The options, if they go with a world, with what is to be recorded.

    Raises:
        BadInput: If a reaction or a recording doesn't.
    """
    check_reactions(world, options.policies, options.news, anticipate=options.anticipate)
    return replace(options, record=asks_of(names_of("record", record) or (), [s.name for s in world.scenarios],
                                           options.trials))


def _target(calibrate: float | str | None) -> Target | None:
    if calibrate is None:
        return None
    text = calibrate if isinstance(calibrate, str) else f"{number('calibrate', calibrate, 0):.17g}%"
    return target_of(text, "calibrate: ")


def _precision(
    precision: float | str | None, max_trials: int | None, trials: int, rollouts: int, *, anytime: bool
) -> Precision | None:
    most = None if max_trials is None else integer("max_trials", max_trials, 1, MOST_TRIALS)
    if precision is None:
        if anytime:
            raise BadInput("anytime belongs to precision: without it the number of trials is fixed")
        if most is not None:
            raise BadInput("max_trials belongs to precision; trials says how many there are without it")
        return None
    text = precision if isinstance(precision, str) else f"{number('precision', precision, 0):.17g}%"
    return precision_of(text, most or 100_000, trials, rollouts, anytime=anytime)


def _process(name: str, value: FailureProcess | None) -> FailureProcess | None:
    return cast("FailureProcess | None", optional(chosen(FailureProcess), name, value))


def _workers(workers: int | None) -> int:
    return count_of(None if workers is None else integer("workers", workers, 1))


def _place(out: PathLike | None) -> Path | None:
    """The folder that receives run folders, if any, in order."""
    if out is None:
        return None
    place = path_of("out", out)
    check_folder(place, "--out")
    tidy(place)
    return place


def _command() -> tuple[str, ...]:
    """How this process was started, which is what it takes to have the run again."""
    return ("python", *(word for word in sys.argv if word))


def _named(plans: object) -> dict[str, object]:
    """Plans by the names that they go by.

    Raises:
        ValueError: If these are no plans.
        BadInput: If there is none, or a name can't be one.
    """
    if isinstance(plans, Plan):
        return {"plan": plans}
    if isinstance(plans, str | os.PathLike):
        return dict(by_name([path_of("plans", plans)]))
    if isinstance(plans, Mapping):
        known: dict[str, str] = {}
        for name in plans:
            if not isinstance(name, str):
                raise ValueError(f"plans: expected names of plans, found a key of type {type(name).__name__}")
            problem = "is empty" if not name else "holds a slash" if "/" in name else what_is_wrong_with(name)
            if problem:
                raise BadInput(f"plans: the name {name[:60]!r} {problem}; it becomes part of file names: choose "
                               "another")
            if folded(name) in known:
                raise BadInput(f"plans: {name!r} and {known[folded(name)]!r}: names must differ, and in more than "
                               "capitals")
            known[folded(name)] = name
        found: dict[str, object] = dict(plans)
    elif isinstance(plans, Sequence):
        found = dict(by_name([path_of(f"plans[{k}]", path) for k, path in enumerate(plans)]))
    else:
        raise ValueError("plans: expected a plan, plans by their names, or paths of plan files, found "
                         f"{type(plans).__name__}")
    if not found:
        raise BadInput("plans: there is none")
    return found


def _label(plans: object, name: str, plan: object) -> Path | str:
    """What messages call a plan: its file, or the argument."""
    if not isinstance(plan, Plan):
        return path_of(f"plans[{name!r}]", plan, "a plan or the path of its file")
    return f"plans[{name!r}]" if isinstance(plans, Mapping) else "plans"
