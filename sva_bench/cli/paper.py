"""Commands of the paper's experiments."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from sva_bench.cli.loading import loading
from sva_bench.cli.options import FidelityOption, Rollouts, Seed, Trials, Verbose, WorkerCount, finite
from sva_bench.cli.terminal import messages, progress_bars, set_up_logging
from sva_bench.cli.usage import PlainCommand, PlainGroup
from sva_bench.files.outputs import check_folder, check_output, write_result
from sva_bench.files.words import words_of
from sva_bench.study.libraries import PRELOAD
from sva_bench.workers.pool import local_workers

paper_app = typer.Typer(cls=PlainGroup, no_args_is_help=True, subcommand_metavar="PART [ARGS]...",
                        help="The paper's experiments again, ours beside its figures.")

_SHIPPED = ("four-rooms", "open-field", "warehouse", "maze")
Page = Annotated[Path | None, typer.Option("--output", "-o", help="Page to write (Markdown); default: standard output.",
                                           show_default=False)]


@paper_app.command(cls=PlainCommand)
def rewards(output: Page = None, verbose: Verbose = False) -> None:
    """Rewards of three vehicles as the third gets less reliable (Figure 4)."""
    set_up_logging(verbose)
    check_output(output)
    with loading():
        from sva_bench.paper import rewards as paper

    with progress_bars() as progress:
        page = paper.rewards_page(paper.rewards(progress=progress))
    write_result(output, page)


@paper_app.command(cls=PlainCommand)
def simulation(
    worlds: Annotated[list[Path] | None, typer.Argument(metavar="[WORLD...]", help="The maps.",
                                                        show_default="four of the shipped ones")] = None,
    trials: Trials = 1000,
    rollouts: Rollouts = 32,
    fidelity: FidelityOption = "rollout",
    seed: Seed = 0,
    output: Page = None,
    workers: WorkerCount = None,
    verbose: Verbose = False,
) -> None:
    """Plans executed in simulation (Figures 7 and 8)."""
    set_up_logging(verbose)
    check_output(output)
    with loading():
        from sva_bench.execution.case import Settings
        from sva_bench.generate.examples import example_world
        from sva_bench.paper import simulation as paper
        from sva_bench.study.inputs import load

    loaded = [load(path) for path in worlds or [example_world(name) for name in _SHIPPED]]
    settings = Settings(seed=seed, trials=trials, rollouts=rollouts, fidelity=fidelity)
    with progress_bars() as progress, local_workers(workers, PRELOAD) as executor:
        page = paper.simulation_page(paper.simulation(loaded, settings, executor, progress), settings)
    write_result(output, page)


@paper_app.command(cls=PlainCommand)
def reaction(
    worlds: Annotated[list[Path] | None, typer.Argument(metavar="[WORLD...]", help="The maps.",
                                                        show_default="the five shipped ones")] = None,
    rollouts: Rollouts = 8,
    fidelity: FidelityOption = "rollout",
    seed: Seed = 0,
    output: Page = None,
    workers: WorkerCount = None,
    verbose: Verbose = False,
) -> None:
    """What stochastic planning is worth if the team reacts, under every process and kind of news.

    The last robot of each world is given availabilities of 25, 50 and 75 %, the others are certain, whatever the file
    says.
    """
    set_up_logging(verbose)
    check_output(output)
    with loading():
        from sva_bench.execution.case import Settings
        from sva_bench.generate.examples import example_world
        from sva_bench.paper import reaction as paper
        from sva_bench.study.inputs import load

    loaded = [load(path) for path in worlds or [example_world(name) for name in (*_SHIPPED, "three-robots")]]
    settings = Settings(seed=seed, trials=1000, rollouts=rollouts, fidelity=fidelity)
    with progress_bars() as progress, local_workers(workers, PRELOAD) as executor:
        page = paper.reaction_page(paper.reaction(loaded, settings, executor, progress), settings)
    write_result(output, page)


@paper_app.command(cls=PlainCommand)
def runtimes(
    whole: Annotated[bool, typer.Option("--whole", help="The paper's whole grid, which takes a day and more; default: "
                                        "four sizes, one seed, one availability, under ten minutes.")] = False,
    method: Annotated[list[str] | None, typer.Option(metavar="NAME,...", help="Only these methods of the five; others "
                                                     "can follow in the same folder.", show_default="all")] = None,
    time_limit: Annotated[float | None, typer.Option(
        metavar="S", min=0, callback=finite, show_default="10, of the whole grid 60",
        help="Wall-clock limit of each solve.")] = None,
    tau: Annotated[float, typer.Option(min=0, callback=finite, help="Mission limit in fuel capacities, which the paper "
                                       "leaves open.")] = 1.0,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder of the rows and the report; a second start "
                                             "goes on there.", show_default="runs/paper-runtimes[-quick]")] = None,
    verbose: Verbose = False,
) -> None:
    """Runtimes, cuts and gaps of the solves (section 5.1: Tables 2 and 3, Figure 3)."""
    set_up_logging(verbose)
    with loading():
        from sva_bench.paper.runtimes import NAME, QUICK, reproduce
        from sva_bench.paper.solves import FULL, METHODS

    study = FULL if whole else QUICK
    if method:
        chosen = words_of(method, "--method ", METHODS, "method in these tables")
        study = replace(study, methods=tuple(name for name in METHODS if name in chosen))
    study = replace(study, tau=tau, time_limit_s=study.time_limit_s if time_limit is None else time_limit)
    folder = out or Path("runs") / (NAME if whole else f"{NAME}-quick")
    check_folder(folder, "--out")
    try:
        with progress_bars() as progress:
            page = reproduce(study, folder, lambda done, of, _: progress("solving", done, of))
    except KeyboardInterrupt:
        messages.print(f"{folder} keeps what is done, and the same command goes on", highlight=False)
        raise
    write_result(None, page)
