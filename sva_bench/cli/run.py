"""Commands that execute missions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from sva_bench.cli.loading import loading
from sva_bench.cli.options import (
    Anticipate,
    AsCsv,
    AsJson,
    Calibrate,
    DeparturesOption,
    ExecuteFailure,
    FidelityOption,
    Gap,
    InteractionOption,
    MarginOption,
    NewsNames,
    Out,
    PlanFailure,
    PlannerOption,
    PolicyNames,
    RecordWords,
    Rollouts,
    ScenarioNames,
    Seed,
    TimeLimit,
    Trials,
    Verbose,
    Wide,
    WorkerCount,
    WorldArgument,
)
from sva_bench.cli.terminal import messages, print_json, progress_bars, set_up_logging
from sva_bench.errors import BadInput, ExitCode
from sva_bench.files.outputs import check_folder
from sva_bench.study.bounds import MOST_TRIALS
from sva_bench.study.libraries import PRELOAD, load_libraries
from sva_bench.study.reacting import check_reactions, news_of, policies_of, refuse_the_name
from sva_bench.workers.pool import local_workers

if TYPE_CHECKING:
    from sva_bench.study.publish import Run
    from sva_bench.world.model import World

"""Refused: whoever looks for it here is told where it is."""


def run(
    world: WorldArgument,
    seed: Seed = 0,
    trials: Trials = 1000,
    rollouts: Rollouts = 32,
    fidelity: FidelityOption = "rollout",
    planner: PlannerOption = "prmstar",
    scenario: ScenarioNames = None,
    margin: MarginOption = None,
    plan_failure: PlanFailure = None,
    execute_failure: ExecuteFailure = None,
    policy: PolicyNames = None,
    news: NewsNames = None,
    anticipate: Anticipate = False,
    calibrate: Calibrate = None,
    interaction: InteractionOption = None,
    departures: DeparturesOption = None,
    time_limit: TimeLimit = None,
    gap: Gap = 1e-6,
    evpi: Annotated[bool, typer.Option("--evpi", help="Work out the value of perfect information however long it "
                                                      "takes.")] = False,
    informed: Annotated[bool, typer.Option("--informed", help="Execute as well what somebody would plan who knew "
                                                              "beforehand who is available.")] = False,
    assumptions: Annotated[bool, typer.Option("--assumptions", help="Execute the plans made for each failure process "
                                              "under all of them: what does the wrong assumption cost?")] = False,
    precision: Annotated[str | None, typer.Option(
        metavar="PCT%", help="Go on with more trials and noise draws until the interval of the executed VSS is within "
        "so many per cent of the stochastic plan's mean.", show_default="none")] = None,
    anytime: Annotated[bool, typer.Option("--anytime", help="With --precision: stop by intervals that hold whenever a "
                                          "run stops, wider ones.")] = False,
    max_trials: Annotated[int | None, typer.Option(
        min=1, max=MOST_TRIALS, help="With --precision: trials at which to stop all the same.",
        show_default="100000")] = None,
    record: RecordWords = None,
    live: Annotated[bool, typer.Option("--live", help="Show robots in the Rerun viewer as they drive, under the first "
                                       "noise draw.")] = False,
    out: Out = Path("runs"),
    workers: WorkerCount = None,
    csv: AsCsv = False,
    as_json: AsJson = False,
    wide: Wide = False,
    verbose: Verbose = False,
) -> None:
    """Plan, execute, record and measure a mission: the main job.

    Writes a run folder with travel times, instances, plans, outcomes, recordings and a summary.
    """
    with loading():
        from sva_bench.analysis.calibration import target_of
        from sva_bench.analysis.precision import precision_of
        from sva_bench.recording.viewer import refuse_without_screen, watching
        from sva_bench.study.inputs import about, load
        from sva_bench.study.recordings import asks_of

    set_up_logging(verbose)
    if precision is None and max_trials is not None:
        raise BadInput("--max-trials belongs to --precision; --trials says how many there are without it")
    if precision is None and anytime:
        raise BadInput("--anytime belongs to --precision: without it the number of trials is fixed, and every interval "
                       "holds as it is")
    asked = None if precision is None else precision_of(precision, max_trials or 100_000, trials, rollouts,
                                                        anytime=anytime)
    target = None if calibrate is None else target_of(calibrate)
    policies, heard = policies_of(policy or ()), news_of(news or ())
    check_folder(out, "--out")
    if live:
        refuse_without_screen()
    loaded = load(world, scenario, margin, plan_failure, execute_failure, interaction, departures)
    check_reactions(loaded, policies, heard, anticipate=anticipate)
    if live and loaded.meets:
        raise BadInput("--live: robots that meet are played mission by mission, and not seen before it is over; leave "
                       "it out, and see the recordings afterwards")
    recorded = asks_of(record or (), [told.name for told in loaded.scenarios], trials)
    load_libraries()  # after the world is read: an error in the file is said at once
    with loading():
        from sva_bench.solver.two_stage import SolveLimits
        from sva_bench.storage.run_folder import tidy
        from sva_bench.study.options import Options
        from sva_bench.study.run import run as run_bench

    tidy(out)
    options = Options(seed=seed, trials=trials, rollouts=rollouts, fidelity=fidelity, planner=planner,
                      limits=SolveLimits(time_limit_s=time_limit, gap=gap), evpi=evpi, informed=informed,
                      assumptions=assumptions, policies=policies, news=heard, anticipate=anticipate,
                      calibrate=target, precision=asked, record=recorded)
    with about(world), progress_bars() as progress, local_workers(workers, PRELOAD) as executor:
        result = run_bench(loaded, options, out, executor, progress, watching(loaded) if live else None)
    _show(result, loaded, as_json, csv=csv, wide=wide, sources=verbose)


def execute(
    world: WorldArgument,
    plans: Annotated[list[Path], typer.Argument(metavar="PLAN...", help="Plan files (JSON or CSV), by hand or from "
                                                "anywhere.", show_default=False)],
    allow_infeasible: Annotated[bool, typer.Option("--allow-infeasible", help="Drive plans that break fuel capacity "
                                                   "or mission limit too: seeing them fail is the point. What no robot "
                                                   "could drive is refused all the same: unknown sites, legs without a "
                                                   "way, a POI visited twice, routes that don't begin and end at the "
                                                   "base.")] = False,
    seed: Seed = 0,
    trials: Trials = 1000,
    rollouts: Rollouts = 32,
    fidelity: FidelityOption = "rollout",
    planner: PlannerOption = "prmstar",
    scenario: ScenarioNames = None,
    margin: MarginOption = None,
    execute_failure: ExecuteFailure = None,
    policy: PolicyNames = None,
    news: NewsNames = None,
    anticipate: Anticipate = False,
    interaction: InteractionOption = None,
    departures: DeparturesOption = None,
    record: RecordWords = None,
    out: Out = Path("runs"),
    workers: WorkerCount = None,
    csv: AsCsv = False,
    as_json: AsJson = False,
    wide: Wide = False,
    verbose: Verbose = False,
) -> None:
    """Execute plans from anywhere in a world and compare them, pair by pair.

    Exits with 3 if a plan is infeasible, unless it is allowed.
    """
    with loading():
        from sva_bench.study.given_plans import read_plans
        from sva_bench.study.inputs import about, by_name, load
        from sva_bench.study.recordings import asks_of

    set_up_logging(verbose)
    policies, heard = policies_of(policy or ()), news_of(news or ())
    check_folder(out, "--out")
    named = by_name(plans)
    loaded = load(world, scenario, margin, execute_failure=execute_failure, interaction=interaction,
                  departures=departures)
    check_reactions(loaded, policies, heard, anticipate=anticipate)
    refuse_the_name(named, anticipate=anticipate)
    recorded = asks_of(record or (), [told.name for told in loaded.scenarios], trials)
    read = read_plans(loaded, named)
    load_libraries()
    with loading():
        from sva_bench.storage.run_folder import tidy
        from sva_bench.study.compare import execute_plans
        from sva_bench.study.costs import plan_costs
        from sva_bench.study.options import Options
        from sva_bench.study.planning import check_plans

    tidy(out)
    options = Options(seed=seed, trials=trials, rollouts=rollouts, fidelity=fidelity, planner=planner,
                      policies=policies, news=heard, anticipate=anticipate, record=recorded)
    with about(world), progress_bars() as progress:
        costs = plan_costs(loaded, planner, progress)
        check_plans(loaded, costs, read, named, allow_infeasible=allow_infeasible)
        with local_workers(workers, PRELOAD) as executor:
            result = execute_plans(loaded, read, options, out, executor, progress, costs)
    _show(result, loaded, as_json, csv=csv, wide=wide, sources=verbose)


def _show(done: Run, world: World, as_json: bool, *, csv: bool, wide: bool, sources: bool) -> None:
    summary, folder = done.summary, done.folder
    with loading():
        from sva_bench.cli.tables import print_summary
        from sva_bench.files.records import as_dict
        from sva_bench.report.doubts import failed_physics
        from sva_bench.storage.stored_run import write_csv

    if csv:
        write_csv(folder)
    if as_json:
        print_json(as_dict(summary))
    else:
        print_summary(summary, wide=wide, sources=sources, world=world, unused=done.unused)
        messages.print(f"written to [bold]{escape(str(folder))}[/bold]", highlight=False)
    if failed := failed_physics(summary):
        if as_json:
            messages.print(*failed, highlight=False)
        raise typer.Exit(ExitCode.UNFINISHED_TRIALS)
