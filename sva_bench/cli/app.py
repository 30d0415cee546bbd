"""The commands, each from its module: nothing is done here but naming them."""

from __future__ import annotations

from typing import Annotated

import typer

from sva_bench import __version__
from sva_bench.cli.batch import batch_app
from sva_bench.cli.doctor import doctor
from sva_bench.cli.expect import expect
from sva_bench.cli.export import export
from sva_bench.cli.inputs import instance_app, world_app
from sva_bench.cli.paper import paper_app
from sva_bench.cli.plans import certify, plan, times
from sva_bench.cli.replay import replay
from sva_bench.cli.run import execute, run
from sva_bench.cli.usage import OneAtATime, PlainCommand, PlainGroup
from sva_bench.cli.verify import verify
from sva_bench.cli.view import report, view

app = typer.Typer(
    cls=PlainGroup, no_args_is_help=True, pretty_exceptions_enable=False, rich_markup_mode="rich",
    help="What is a multi-robot mission plan worth when robots fail? Plans missions, executes them in physics with "
         "randomised failures, and measures the value of the stochastic solution (VSS).",
    epilog="Exit codes: 0 done (a plan at its limit too), 1 a fault of the program or the installation, 2 bad input or "
           "usage, 3 an infeasible plan, 4 some trials could not be finished, 5 an expectation not met, 130 "
           "interrupted (143 by SIGTERM, 129 by SIGHUP); what is done is kept.")

for command in (run, times, plan, certify, execute, expect, export):
    app.command(cls=PlainCommand)(command)
app.command(cls=OneAtATime)(view)
app.command(cls=OneAtATime)(report)
app.command(cls=OneAtATime)(replay)
app.command(cls=OneAtATime)(verify)
app.command(cls=PlainCommand)(doctor)
for name, group in (("batch", batch_app), ("world", world_app), ("instance", instance_app), ("reproduce", paper_app)):
    app.add_typer(group, name=name)


@app.callback(invoke_without_command=True)
def _main(version: Annotated[bool, typer.Option("--version", help="Print the version.", is_eager=True)] = False
          ) -> None:
    if version:
        typer.echo(f"sva-bench {__version__}")
        raise typer.Exit
