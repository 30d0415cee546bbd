"""The command that checks what a run or batch says against what is expected of it: for CI."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sva_bench.cli.loading import loading
from sva_bench.cli.options import AsJson
from sva_bench.cli.terminal import print_hanging, print_json, refuse_closed_output
from sva_bench.errors import ExitCode
from sva_bench.files.outputs import check_output, write_result


def expect(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run or batch.", show_default=False)],
    expressions: Annotated[list[str], typer.Argument(metavar="EXPRESSION...", help="What its summary is to say, such "
                                                     "as 'S3.vss.executed_pct >= 5'.", show_default=False)],
    junit: Annotated[Path | None, typer.Option("--junit", metavar="FILE", help="Write the outcome as a JUnit report "
                                               "too.", show_default="none")] = None,
    as_json: AsJson = False,
) -> None:
    """Check what a run or batch says against what is expected of it; exits with 5 if something doesn't hold.

    An expression is PATH OPERATOR VALUE: 'S3.vss.executed.ci95[0] > 0', 'S2.plans.stochastic.ends.stuck <= 10',
    '["S.3"].vss.distinguishable == true', 'fidelity == physics'. A path begins with a scenario or a key of
    summary.json; the value may be another path.
    """
    with loading():
        from sva_bench.analysis.expectations import judge
        from sva_bench.report.junit import junit_report
        from sva_bench.storage.stored_run import read_any_summary

    refuse_closed_output()
    if junit is not None:
        check_output(junit, folder / "summary.json", way_out="choose another place with --junit")
    summary = read_any_summary(folder)
    judged = [judge(expression, summary) for expression in expressions]
    if junit is not None:
        write_result(junit, junit_report(str(summary.get("world", folder.name)), judged))
    if as_json:
        print_json({"format": "sva-bench/expectations@1", "met": all(one.met for one in judged),
                    "expectations": [one.as_dict() for one in judged]})
    else:
        for one in judged:
            print_hanging(one.said(), "ok      " if one.met else "NOT MET ")
    if not all(one.met for one in judged):
        raise typer.Exit(ExitCode.EXPECTATION_NOT_MET)
