"""The command that writes plans and trials for other programs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer

from sva_bench.choices import EXPORT_FORMATS, TRIAL_FORMATS, AnyFormat, ExportFormat, TrialFormat
from sva_bench.cli.loading import loading
from sva_bench.cli.options import TRIAL_METAVAR, InteractionOption, Verbose, WorkerCount
from sva_bench.cli.terminal import progress_bars, say_written, set_up_logging
from sva_bench.errors import BadInput
from sva_bench.files.outputs import check_output, write_result
from sva_bench.study.libraries import PRELOAD, load_libraries
from sva_bench.study.reacting import news_of, policies_of
from sva_bench.workers.pool import local_workers

_FORMATS = "; ".join(f"{name}: {said}" for name, said in (*EXPORT_FORMATS.items(), *TRIAL_FORMATS.items()))
_OF_TRIALS = "Of a trial: "


def export(
    source: Annotated[Path, typer.Argument(metavar="PLAN-or-RUN", help="Plan file (JSON or CSV); for a trial, the "
                                           "run's folder.", show_default=False)],
    to: Annotated[AnyFormat, typer.Option(help=f"What for. {_FORMATS}.", show_default=False)],
    world: Annotated[Path | None, typer.Option(metavar="WORLD", help="Of a plan: the world file (YAML) that it is "
                                               "for.", show_default=False)] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="File to write; default: standard output.",
                                                show_default=False)] = None,
    robot: Annotated[str | None, typer.Option(help="Of a plan: only this robot's route.",
                                              show_default="all that leave")] = None,
    interaction: InteractionOption = None,
    trial: Annotated[str | None, typer.Option(metavar=TRIAL_METAVAR, help=f"{_OF_TRIALS}its number, as in "
                                              "outcomes.parquet, or which one.", show_default=False)] = None,
    scenario: Annotated[str | None, typer.Option(help=f"{_OF_TRIALS}the scenario.", show_default="the only one")
                        ] = None,
    planner: Annotated[str | None, typer.Option(help=f"{_OF_TRIALS}whose plan.", show_default="stochastic")] = None,
    policy: Annotated[str | None, typer.Option(help=f"{_OF_TRIALS}what the team does about failures.",
                                               show_default="none")] = None,
    news: Annotated[str | None, typer.Option(help=f"{_OF_TRIALS}when it learns of one.",
                                             show_default="the only one of the run")] = None,
    workers: WorkerCount = None,
    verbose: Verbose = False,
) -> None:
    """Write a plan for other programs (Nav2 waypoints, GeoJSON, CSV), or a trial as a ROS 2 bag (MCAP)."""
    set_up_logging(verbose)
    of_plans = {"--world": world, "--robot": robot, "--interaction": interaction}
    of_trials = {"--trial": trial, "--scenario": scenario, "--planner": planner, "--policy": policy, "--news": news}
    if to in TRIAL_FORMATS:
        _refuse(to, of_plans, "which a run's folder says itself" if robot is None else "a bag holds all robots")
        if trial is None:
            raise BadInput(f"--to {to} writes one trial: say which with --trial")
        policies, heard = policies_of([policy or "none"]), news_of([] if news is None else [news])
        if len(policies) > 1 or len(heard) > 1:
            raise BadInput("--policy, --news: one of each is exported at a time; name one")
        check_output(output)
        load_libraries()
        with loading():
            from sva_bench.storage.trial_choice import choice_of
            from sva_bench.study.replay import Wanted
            from sva_bench.study.trial_exports import TRIAL_EXPORTS, export_trial

        choice = choice_of(trial)
        wanted = Wanted(scenario=scenario, trial=choice.trial, kind=choice.kind, planner=planner, policy=policies[0],
                        news=heard[0] if heard else None)
        kind: TrialFormat = next(name for name in TRIAL_EXPORTS if name == to)
        with progress_bars() as progress, local_workers(workers, PRELOAD) as executor:
            bag = export_trial(source, wanted, kind, executor, progress)
        write_result(output, bag)
        say_written(output)
        return
    _refuse(to, of_trials, "a plan is no trial of a run")
    if source.is_dir():
        raise BadInput(f"{source}: a folder, and --to {to} writes a plan: name its file, as in "
                       f"{source / 'plans' / 'S1-stochastic.json'}, and its world with --world")
    if world is None:
        raise BadInput(f"--to {to} writes a plan, whose sites stand in a world: name its file with --world")
    _export_plan(source, world, next(name for name in EXPORT_FORMATS if name == to), output, robot, interaction)


def _refuse(to: str, options: Mapping[str, object], why: str) -> None:
    """Refuse options that belong to the other kind of export."""
    if given := [name for name, value in options.items() if value is not None]:
        raise BadInput(f"--to {to} has no use for {', '.join(given)}: {why}; leave it out")


def _export_plan(plan: Path, world: Path, to: ExportFormat, output: Path | None, robot: str | None,
                 interaction: InteractionOption) -> None:
    with loading():
        from sva_bench.study.given_plans import read_plans
        from sva_bench.study.inputs import about, load

    check_output(output, world, plan)
    loaded = load(world, interaction=interaction)
    read = read_plans(loaded, {"plan": plan})["plan"]
    with loading():
        from sva_bench.study.costs import plan_costs
        from sva_bench.study.exports import EXPORTS, Exported
        from sva_bench.study.planning import check_plans

    with about(world), progress_bars() as progress:
        costs = plan_costs(loaded, "prmstar", progress)
        check_plans(loaded, costs, {"plan": read}, {"plan": plan}, allow_infeasible=True)
        content = EXPORTS[to](Exported(world=loaded, costs=costs, plan=read, robot=robot))
    write_result(output, content)
    say_written(output)
