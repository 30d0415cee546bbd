"""The command that checks the installation."""

from __future__ import annotations

import textwrap

import typer

from sva_bench.cli.loading import loading
from sva_bench.cli.options import AsJson
from sva_bench.cli.terminal import print_json, refuse_closed_output, results
from sva_bench.errors import ExitCode


def doctor(as_json: AsJson = False) -> None:
    """Check the installation: versions, and whether physics, planner, solver and viewer work here.

    Parts that are missing are for one command or option each, which is named with what to install; exits with 1 only
    if something that a run needs doesn't work.
    """
    refuse_closed_output()
    with loading():
        from sva_bench.cli.installation import check_installation

    checked = check_installation()
    broken = [one for one in checked if one.state == "failed"]
    if as_json:
        print_json({"format": "sva-bench/doctor@1", "works": not broken, "parts": [one.as_dict() for one in checked]})
    else:
        width = max(len(one.part) for one in checked)
        for one in checked:
            state = {"ok": "ok     ", "missing": "missing", "failed": "FAILED "}[one.state]
            head, console = f"{state} {one.part:{width}}  ", results()
            for line in textwrap.wrap(head + one.found, console.width, subsequent_indent=" " * len(head),
                                      break_long_words=False, break_on_hyphens=False):
                console.print(line, highlight=False, markup=False, soft_wrap=True)
    if broken:
        raise typer.Exit(ExitCode.FAULT)
