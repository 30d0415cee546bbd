"""Commands of batches."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_args

import typer
from rich.markup import escape

from sva_bench.choices import Fidelity, PathPlanner
from sva_bench.cli.loading import loading
from sva_bench.cli.options import (
    Anticipate,
    AsJson,
    Calibrate,
    CompareKeys,
    DeparturesOption,
    ExecuteFailure,
    InteractionOption,
    MarginOption,
    NewsNames,
    PlanFailure,
    PolicyNames,
    ScenarioNames,
    TimeLimit,
    Verbose,
    Wide,
    WorkerCount,
    finite,
)
from sva_bench.cli.terminal import (
    messages,
    print_json,
    progress_bars,
    refuse_closed_output,
    results,
    set_up_logging,
)
from sva_bench.cli.usage import PlainCommand, UnnamedCommand, WorldsFirst
from sva_bench.errors import BadInput, ExitCode, Interrupted
from sva_bench.files.outputs import check_folder
from sva_bench.files.printable import counted
from sva_bench.study.bounds import MOST_ROLLOUTS, MOST_TRIALS
from sva_bench.study.libraries import load_libraries
from sva_bench.study.reacting import news_of, policies_of

if TYPE_CHECKING:
    from sva_bench.batch.compared import Asked
    from sva_bench.batch.grid import Grid
    from sva_bench.workers.engine import Engine


batch_app = typer.Typer(cls=WorldsFirst, rich_markup_mode="rich",
                        help="Monte Carlo over many worlds; 'batch status DIR', 'batch retry DIR'.")

Folder = Annotated[Path, typer.Argument(metavar="DIR", help="The batch folder.", show_default=False)]
CacheOption = Annotated[Path | None, typer.Option("--cache", metavar="DIR", help="Folder of travel times, plans and "
                                                  "drives that batches share.", show_default="the user's cache")]
DaskOption = Annotated[str | None, typer.Option("--dask", metavar="ADDRESS", help="Run on the Dask cluster of this "
                                                "scheduler, or of this scheduler file.", show_default="here")]
UnitTimeLimit = Annotated[float, typer.Option("--unit-time-limit", metavar="S", min=0.1, callback=finite,
                                              help="A unit that takes longer is tried again, twice, then given up.")]
TablesAsCsv = Annotated[bool, typer.Option("--csv", help="Write the tables map by map and over maps as CSV too.")]
MemoryMb = Annotated[int, typer.Option("--memory-mb", min=0, help="Memory that a unit may take; 0 = any.")]


@batch_app.command(cls=UnnamedCommand, epilog="'sva-bench batch status DIR' says how far a batch is, 'sva-bench batch "
                                             "retry DIR' takes up what failed.")
def over(
    worlds: Annotated[list[Path], typer.Argument(metavar="WORLD...", help="World files (YAML), patterns of them, or "
                                                 "one sweep.yaml.", show_default=False)],
    seed: Annotated[list[str] | None, typer.Option(metavar="N or N-M", help="Seeds of failures and noise, also as a "
                                                   "range; may be repeated.", show_default="0")] = None,
    trials: Annotated[int | None, typer.Option(min=1, max=MOST_TRIALS, help="Trials of each plan in each scenario.",
                                               show_default="1000")] = None,
    rollouts: Annotated[int | None, typer.Option(min=1, max=MOST_ROLLOUTS, help="Noise draws; trial t has number t mod "
                                                 "ROLLOUTS.", show_default="32")] = None,
    fidelity: Annotated[Fidelity | None, typer.Option(help="The kinematic twin alone; physics once per leg and "
                                                      "noise draw; or every trial in physics.",
                                                      show_default="rollout")] = None,
    planner: Annotated[list[str] | None, typer.Option(
        metavar="NAME", help=f"OMPL planner, as for run: {', '.join(get_args(PathPlanner))}; may be repeated.",
        show_default="prmstar")] = None,
    scenario: ScenarioNames = None,
    vary: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=V1,V2,...", help="Vary a key of the world "
                                                   "files, e.g. robots.uv2.fuel_capacity_s=200,250; robots.* moves all "
                                                   "together, x1.2 is relative to the file; may be repeated.",
                                                   show_default=False)] = None,
    compare: CompareKeys = None,
    margin: MarginOption = None,
    plan_failure: PlanFailure = None,
    execute_failure: ExecuteFailure = None,
    policy: PolicyNames = None,
    news: NewsNames = None,
    anticipate: Anticipate = False,
    calibrate: Calibrate = None,
    interaction: InteractionOption = None,
    departures: DeparturesOption = None,
    evpi: Annotated[bool, typer.Option("--evpi", help="Work out the value of perfect information however long it "
                                                      "takes.")] = False,
    time_limit: TimeLimit = None,
    gap: Annotated[float | None, typer.Option(min=0, callback=finite, help="Relative gap at which a plan counts as "
                                              "optimal.", show_default="1e-06")] = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="The batch folder.",
                                             show_default="runs/batch-<hash>")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Resume: do what is left of the batch "
                                                "in the folder.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="List the grid, with an estimate of time and disk, and do "
                                          "nothing.")] = False,
    workers: WorkerCount = None,
    dask: DaskOption = None,
    unit_trials: Annotated[int | None, typer.Option("--unit-trials", min=1, help="Trials of one unit, which is what "
                                                    "a crash can cost.", show_default="10000; 10 in physics")] = None,
    unit_time_limit: UnitTimeLimit = 3600.0,
    memory_mb: MemoryMb = 4096,
    cache: CacheOption = None,
    as_json: AsJson = False,
    as_csv: TablesAsCsv = False,
    wide: Wide = False,
    verbose: Verbose = False,
) -> None:
    """Monte Carlo over many worlds, seeds and variants: shards of outcomes, and the VSS over maps.

    Nothing that is done is lost, whatever happens: --resume goes on.
    """
    set_up_logging(verbose)
    load_libraries()
    with loading():
        from sva_bench.analysis.calibration import target_of
        from sva_bench.batch.cache import default_folder
        from sva_bench.batch.compared import asked_by
        from sva_bench.batch.grid import batch_name
        from sva_bench.batch.sweep import Sweep, grid_of, planners_of, seeds_of, sweep_of, varied

    if dry_run:  # before worlds are read: with their variants, that takes its time
        refuse_closed_output()
    else:
        check_folder(out or Path("runs"), "--out")
        check_folder(cache or default_folder(), "--cache")
    sweep = sweep_of(worlds, Sweep(
        seeds=seeds_of(seed) if seed else None, trials=trials, rollouts=rollouts, fidelity=fidelity,
        planners=planners_of(planner) if planner else None, scenarios=tuple(scenario) if scenario else None,
        margin=margin, plan_failure=plan_failure, execute_failure=execute_failure, interaction=interaction,
        departures=departures,
        policies=policies_of(policy) if policy else None, news=news_of(news) if news else None,
        anticipate=anticipate or None, calibrate=None if calibrate is None else target_of(calibrate),
        evpi=evpi or None,
        time_limit_s=time_limit, gap=gap,
        vary=varied(vary) if vary else None, compare=tuple(compare or ()), unit_trials=unit_trials))
    with progress_bars() as progress:
        grid = grid_of(sweep, progress)
    asked = asked_by(sweep, grid)  # what is wrong with it is said before hours of work
    folder = out or Path("runs") / batch_name(grid.settings())
    if dry_run:
        _list(grid, folder, cache, as_json, wide=wide)
        return
    _run(grid, folder, workers, dask, unit_time_limit, memory_mb, cache, as_json, as_csv, resume=resume,
         asked=asked, wide=wide)


@batch_app.command(cls=PlainCommand)
def retry(
    folder: Folder,
    compare: CompareKeys = None,
    workers: WorkerCount = None,
    dask: DaskOption = None,
    unit_time_limit: UnitTimeLimit = 3600.0,
    memory_mb: MemoryMb = 4096,
    cache: CacheOption = None,
    as_json: AsJson = False,
    as_csv: TablesAsCsv = False,
    wide: Wide = False,
    verbose: Verbose = False,
) -> None:
    """Take up again what failed or was not done; worlds and settings are those in the folder."""
    set_up_logging(verbose)
    load_libraries()
    with loading():
        from sva_bench.batch.compared import asked_of
        from sva_bench.batch.folder import settings_in
        from sva_bench.batch.grid import grid_of

    _existing(folder)
    grid = grid_of(*settings_in(folder))
    _run(grid, folder, workers, dask, unit_time_limit, memory_mb, cache, as_json, as_csv, resume=True, again=True,
         asked=asked_of(compare or (), grid), wide=wide)


@batch_app.command(cls=PlainCommand)
def status(folder: Folder, as_json: AsJson = False, wide: Wide = False) -> None:
    """How far is a batch, and what does it come to so far? It may be at work."""
    with loading():
        from sva_bench.batch.aggregates import summary_of
        from sva_bench.batch.folder import at_work, failures_in, settings_in, units_in
        from sva_bench.batch.grid import grid_of
        from sva_bench.cli.sheets import print_sheet
        from sva_bench.cli.watching import over_maps, print_failed, reactions_over_maps
        from sva_bench.files.records import as_dict
        from sva_bench.report.calibration_over_maps import calibrated_over_maps

    refuse_closed_output()
    _existing(folder)
    running = at_work(folder)
    grid = grid_of(*settings_in(folder))
    units = grid.units()
    done = units_in(folder) & set(units)
    failures = [failure for failure in failures_in(folder) if failure.unit not in done]
    summary = summary_of(grid, folder, done, failures)
    if as_json:
        print_json({"format": "sva-bench/batch-status@1", "at_work": running, "units": len(units), "done": len(done),
                    "aggregate": [as_dict(row) for row in summary.aggregate],
                    **({"reactions": [as_dict(row) for row in summary.reactions]} if summary.reactions else {}),
                    "failed": [as_dict(unit) for unit in summary.failed]})
        return
    console = results()
    state = "at work" if running else "complete" if len(done) == len(units) else "not at work; --resume goes on" \
        if len(done) + len(failures) < len(units) else "over"
    console.print(f"{len(done)} of {counted(len(units), 'unit')} done, {len(failures)} failed: {state}",
                  highlight=False)
    if done:
        print_sheet(over_maps(summary.aggregate, "VSS over maps, so far"), console, wide=wide)
        if summary.reactions:
            print_sheet(reactions_over_maps(summary.reactions), console, wide=wide)
        for said in calibrated_over_maps(summary.units):
            console.print(said, highlight=False, markup=False)
    print_failed(summary.failed, console)


def _list(grid: Grid, folder: Path, cache: Path | None, as_json: bool, *, wide: bool) -> None:
    with loading():
        from sva_bench.batch.cache import Cache, default_folder
        from sva_bench.batch.estimates import estimates, total_s
        from sva_bench.cli.watching import print_grid

    with progress_bars() as progress:
        listed = estimates(grid, Cache(folder=cache or default_folder()), folder, progress)
    if as_json:
        print_json({"format": "sva-bench/batch-grid@1", "processor_s": round(total_s(listed), 1), "strands": [
            {"world": e.point.world.name, "variant": e.point.variant, "seed": e.seed, "units": e.units, "rows": e.rows,
             "disk_mb": round(e.disk_bytes / 1e6, 3), "processor_s": round(e.processor_s, 1)} for e in listed]})
    else:
        print_grid(listed, wide=wide)


def _existing(folder: Path) -> None:
    if not folder.is_dir():
        raise BadInput(f"{folder}: there is no such folder")


def _run(
    grid: Grid, folder: Path, workers: int | None, dask: str | None, unit_time_limit_s: float, memory_mb: int,
    cache: Path | None, as_json: bool, as_csv: bool, *, resume: bool, again: bool = False,
    asked: Sequence[Asked] = (), wide: bool = False,
) -> None:
    with loading():
        from sva_bench.batch.cache import Cache, default_folder
        from sva_bench.batch.folder import units_in
        from sva_bench.batch.run import run_batch
        from sva_bench.batch.tables import write_tables
        from sva_bench.cli.watching import print_batch, watching
        from sva_bench.files.records import as_dict
        from sva_bench.workers.answers import Caps
        from sva_bench.workers.local import LocalProcesses
        from sva_bench.workers.pool import count_of

    if dask is not None and workers is not None:
        raise BadInput("--dask and --workers don't go together: the cluster has its own workers")
    caps = Caps(time_s=unit_time_limit_s, memory_mb=memory_mb, preload="sva_bench.batch.jobs")

    @contextmanager
    def engine() -> Iterator[Engine]:
        running: Engine
        if dask is None:
            running = LocalProcesses(count_of(workers), caps)
        else:
            with loading():
                from sva_bench.workers.dask import DaskCluster

            running = DaskCluster(dask, caps)
        try:
            yield running
        finally:
            running.close()

    check_folder(folder, "--out")
    check_folder(cache or default_folder(), "--cache")
    try:
        with watching() as report:
            summary = run_batch(grid, folder, engine, Cache(folder=cache or default_folder()), report, resume=resume,
                                retry=again, compare=asked)
    except KeyboardInterrupt:
        done = len(units_in(folder) & set(grid.units()))
        units = counted(len(grid.units()), "unit is", "units are")
        raise Interrupted(f"interrupted: {done} of {units} done and kept in {folder}; the same command goes on with "
                          "--resume") from None
    if as_csv:
        write_tables(folder, summary)
    if as_json:
        print_json(as_dict(summary))
    else:
        print_batch(summary, wide=wide)
        messages.print(f"written to [bold]{escape(str(folder))}[/bold]", highlight=False)
    if summary.failed:
        if as_json:
            messages.print(f"{counted(len(summary.failed), 'unit was', 'units were')} given up", highlight=False)
        raise typer.Exit(ExitCode.UNFINISHED_TRIALS)
