"""The command that works out again what a run folder claims."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sva_bench.cli.loading import loading
from sva_bench.cli.options import AsJson, Verbose, WorkerCount
from sva_bench.cli.terminal import print_hanging, print_json, progress_bars, refuse_closed_output, set_up_logging
from sva_bench.errors import ExitCode
from sva_bench.study.libraries import PRELOAD, load_libraries
from sva_bench.workers.pool import local_workers


def verify(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="Run folder.", show_default=False)],
    sample: Annotated[int, typer.Option(min=0, max=10_000, metavar="N", help="How many trials of each plan and "
                                        "reaction are played again.")] = 3,
    workers: WorkerCount = None,
    as_json: AsJson = False,
    verbose: Verbose = False,
) -> None:
    """Work out again what a run folder claims; exits with 5 and the first difference if it doesn't hold.

    Travel times and instances from the world; certificates of all plans; means, ends, VSS and ledgers from the tables;
    a sample of trials, played again and compared row by row. Nothing is written.
    """
    set_up_logging(verbose)
    refuse_closed_output()
    with loading():
        from sva_bench.storage.stored_run import run_folder_at

    run_folder_at(folder)
    load_libraries()
    with loading():
        from sva_bench.study.verify import verify as work_out_again

    with progress_bars() as progress, local_workers(workers, PRELOAD) as executor:
        found = work_out_again(folder, sample, executor, progress)
    if as_json:
        print_json(found.as_dict())
    else:
        for line in found.checked:
            print_hanging(line, "ok      ")
        if found.difference is not None:
            print_hanging(str(found.difference), "DIFFERS ")
    if found.difference is not None:
        raise typer.Exit(ExitCode.EXPECTATION_NOT_MET)
