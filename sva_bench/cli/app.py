"""Commands: nothing but parsing, calling, printing."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from sva_bench import __version__
from sva_bench.cli.batch import batch_app
from sva_bench.cli.libraries import load_libraries
from sva_bench.cli.making import instance_app, world_app
from sva_bench.cli.options import (
    AsCsv,
    AsJson,
    ExecuteFailure,
    FidelityOption,
    Gap,
    MarginOption,
    Out,
    PlanFailure,
    PlannerOption,
    Rollouts,
    ScenarioNames,
    Seed,
    TimeLimit,
    Trials,
    Verbose,
    WorkerCount,
    WorldArgument,
)
from sva_bench.cli.paper import paper_app
from sva_bench.cli.plans import certify, plan, times
from sva_bench.cli.terminal import messages, print_json, print_summary, progress_bars, set_up_logging
from sva_bench.cli.usage import PlainCommand
from sva_bench.errors import BadInput
from sva_bench.files.outputs import check_folder, check_output
from sva_bench.interrupts import holding_back_ctrl_c
from sva_bench.workers.pool import local_workers

if TYPE_CHECKING:
    from sva_bench.analysis.summaries import AnySummary

_PRELOAD = "sva_bench.execution.execute"
"""What worker processes load while this one plans."""

app = typer.Typer(
    no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False, rich_markup_mode="rich",
    help="What is a multi-robot mission plan worth when robots fail? Plans missions, executes them in physics with "
         "randomised failures, and measures the value of the stochastic solution (VSS).",
    epilog="Exit codes: 0 done, 1 a fault of the program, 2 bad input or usage, 3 an infeasible plan, "
           "4 some trials unfinished, 130 interrupted.")

app.add_typer(batch_app, name="batch")
app.add_typer(world_app, name="world")
app.add_typer(instance_app, name="instance")
app.add_typer(paper_app, name="reproduce")


@app.command(cls=PlainCommand)
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
    time_limit: TimeLimit = None,
    gap: Gap = 1e-6,
    evpi: Annotated[bool, typer.Option("--evpi", help="Work out the value of perfect information however long it "
                                                      "takes.")] = False,
    informed: Annotated[bool, typer.Option("--informed", help="Execute as well what somebody would plan who knew "
                                                              "beforehand who is available.")] = False,
    assumptions: Annotated[bool, typer.Option("--assumptions", help="Execute plans made for mission under per_leg and "
                                              "the reverse: what does the wrong assumption cost?")] = False,
    precision: Annotated[str | None, typer.Option(
        metavar="PCT%", help="Go on with more trials and noise draws until the interval of the executed VSS is within "
        "so many per cent of the stochastic plan's mean.", show_default="none")] = None,
    max_trials: Annotated[int | None, typer.Option(
        min=1, max=10_000_000, help="With --precision: trials at which to stop all the same.",
        show_default="100000")] = None,
    out: Out = Path("runs"),
    workers: WorkerCount = None,
    csv: AsCsv = False,
    as_json: AsJson = False,
    verbose: Verbose = False,
) -> None:
    """Plan, execute, record and measure a mission: the main job.

    Writes a run folder with travel times, instances, plans, outcomes, recordings and a summary.
    """
    with holding_back_ctrl_c():
        from sva_bench.analysis.precision import precision_of
        from sva_bench.cli.loading import about, load

    set_up_logging(verbose)
    if precision is None and max_trials is not None:
        raise BadInput("--max-trials belongs to --precision; --trials says how many there are without it")
    asked = None if precision is None else precision_of(precision, max_trials or 100_000, trials, rollouts)
    check_folder(out, "--out")
    loaded = load(world, scenario, margin, plan_failure, execute_failure)
    load_libraries()  # after the world is read: an error in the file is said at once
    with holding_back_ctrl_c():
        from sva_bench.solver.two_stage import SolveLimits
        from sva_bench.storage.run_folder import tidy
        from sva_bench.study.options import Options
        from sva_bench.study.run import run as run_bench

    tidy(out)
    options = Options(seed=seed, trials=trials, rollouts=rollouts, fidelity=fidelity, planner=planner,
                      limits=SolveLimits(time_limit_s=time_limit, gap=gap), evpi=evpi, informed=informed,
                      assumptions=assumptions, precision=asked)
    with about(world), progress_bars() as progress, local_workers(workers, _PRELOAD) as executor:
        result = run_bench(loaded, options, out, executor, progress)
    _show(result.summary, result.folder, as_json, csv=csv)


for command in (times, plan, certify):
    app.command(cls=PlainCommand)(command)


@app.command(cls=PlainCommand)
def execute(
    world: WorldArgument,
    plans: Annotated[list[Path], typer.Argument(metavar="PLAN...", help="Plan files (JSON), by hand or from anywhere.",
                                                show_default=False)],
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
    out: Out = Path("runs"),
    workers: WorkerCount = None,
    csv: AsCsv = False,
    as_json: AsJson = False,
    verbose: Verbose = False,
) -> None:
    """Execute plans from anywhere in a world and compare them, pair by pair.

    Exits with 3 if a plan is infeasible, unless it is allowed.
    """
    with holding_back_ctrl_c():
        from sva_bench.cli.loading import about, by_name, load
        from sva_bench.study.given_plans import read_plans

    set_up_logging(verbose)
    check_folder(out, "--out")
    named = by_name(plans)
    loaded = load(world, scenario, margin, execute_failure=execute_failure)
    read = read_plans(loaded, named)
    load_libraries()
    with holding_back_ctrl_c():
        from sva_bench.storage.run_folder import tidy
        from sva_bench.study.compare import execute_plans
        from sva_bench.study.costs import plan_costs
        from sva_bench.study.options import Options
        from sva_bench.study.planning import check_plans

    tidy(out)
    options = Options(seed=seed, trials=trials, rollouts=rollouts, fidelity=fidelity, planner=planner)
    with about(world), progress_bars() as progress:
        costs = plan_costs(loaded, planner, progress)
        check_plans(loaded, costs, read, named, allow_infeasible=allow_infeasible)
        with local_workers(workers, _PRELOAD) as executor:
            result = execute_plans(loaded, read, options, out, executor, progress, costs)
    _show(result.summary, result.folder, as_json, csv=csv)


@app.command(cls=PlainCommand)
def view(
    recording: Annotated[Path, typer.Argument(metavar="RUN-or-RRD", help="Run folder, or one recording.",
                                              show_default=False)],
    web: Annotated[bool, typer.Option("--web", help="Serve it to a browser, on this machine only.")] = False,
    screenshot: Annotated[Path | None, typer.Option(metavar="OUT.png", help="Take a picture without a screen.",
                                                    show_default=False)] = None,
    at: Annotated[float | None, typer.Option(metavar="S", min=0, help="Mission time of the picture.",
                                             show_default="the end")] = None,
) -> None:
    """Open recordings in the Rerun viewer."""
    with holding_back_ctrl_c():
        from sva_bench.recording.viewer import view as open_viewer
        from sva_bench.storage.stored_run import missing, run_folder_at

    if recording.is_dir() and next((recording / "recordings").glob("*.rrd"), None) is None:
        raise missing(run_folder_at(recording), recording / "recordings" / "*.rrd")  # or what it is, if it is none
    if screenshot is not None:
        check_output(screenshot, way_out="choose another place with --screenshot")
    open_viewer(recording, web=web, screenshot=screenshot, at_s=at)


@app.command(cls=PlainCommand)
def report(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="Run folder.", show_default=False)],
    csv: AsCsv = False,
    verbose: Verbose = False,
) -> None:
    """Write the report of a finished run again, from its tables."""
    with holding_back_ctrl_c():
        from sva_bench.storage.stored_run import write_csv
        from sva_bench.study.publish import report_again

    set_up_logging(verbose)
    if folder.is_dir():  # else it is said what is missing
        check_output(folder / "report.html", way_out="make the folder writable")
    page = report_again(folder)
    if csv:
        write_csv(folder)
    messages.print(f"written to [bold]{escape(str(page))}[/bold]", highlight=False)


@app.callback(invoke_without_command=True)
def _main(version: Annotated[bool, typer.Option("--version", help="Print the version.", is_eager=True)] = False
          ) -> None:
    if version:
        typer.echo(f"sva-bench {__version__}")
        raise typer.Exit


def _show(summary: AnySummary, folder: Path, as_json: bool, *, csv: bool = False) -> None:
    if csv:
        from sva_bench.storage.stored_run import write_csv

        write_csv(folder)
    if as_json:
        from sva_bench.files.records import as_dict

        print_json(as_dict(summary))
    else:
        print_summary(summary)
        messages.print(f"written to [bold]{escape(str(folder))}[/bold]", highlight=False)
