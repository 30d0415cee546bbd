"""Arguments and options that commands share."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from sva_bench.choices import (
    DEPARTURES,
    INTERACTIONS,
    NEWS,
    POLICY_NAMES,
    RECORDED_WORDS,
    USUAL_NEWS,
    Departures,
    FailureProcess,
    Fidelity,
    Interaction,
    PathPlanner,
)
from sva_bench.errors import BadInput
from sva_bench.files.streams import CLOSED, output_is_closed
from sva_bench.study.bounds import MOST_ROLLOUTS, MOST_SEED, MOST_TRIALS
from sva_bench.workers.pool import count_of

# Spelt out, not imported: the modules that own them take a second to load, and --help should not.


def finite(value: float | None) -> float | None:
    """Refuse inf and nan, which pass bounds."""
    if value is not None and not math.isfinite(value):
        raise typer.BadParameter(f"expected a finite number, found {value}")
    return value


def read_by_somebody(asked: bool) -> bool:
    """Refuse to print to a standard output that is closed, before any work."""
    if asked and output_is_closed():
        raise BadInput(f"--json: {CLOSED}; open it, or leave out --json")
    return asked


WorldArgument = Annotated[Path, typer.Argument(metavar="WORLD", help="World file (YAML).", show_default=False)]
CompareKeys = Annotated[list[str] | None, typer.Option("--compare", metavar="KEY[=REFERENCE]", help="Compare the "
                                                       "values of a varied key with one of them, pair by pair; may be "
                                                       "repeated. Reference: the files' own value if it is among them, "
                                                       "else the first.", show_default=False)]
Wide = Annotated[bool, typer.Option("--wide", help="Show all columns of tables, however wide that is.")]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Say more, on standard error.")]
AsJson = Annotated[bool, typer.Option("--json", callback=read_by_somebody, help="Print the result as JSON, and nothing "
                                      "else.")]
PlannerOption = Annotated[PathPlanner, typer.Option(help="OMPL planner: one PRM* roadmap, or pair by pair RRTConnect "
                                                     "(noisy), FMT*, BFMT* or Informed RRT* (slow).")]
MarginOption = Annotated[float | None, typer.Option(
    min=0, max=1, callback=finite, help="Planning costs are twin times x (1 + margin); default: the world's.",
    show_default=False)]
TimeLimit = Annotated[float | None, typer.Option(
    metavar="S", min=0, callback=finite, help="Stop each solve after so many seconds and take its best plan.",
    show_default="none")]
Seed = Annotated[int, typer.Option(min=0, max=MOST_SEED, help="Seed of failures and noise; plans don't depend on it.")]
Trials = Annotated[int, typer.Option(min=1, max=MOST_TRIALS, help="Trials of each plan in each scenario.")]
RecordWords = Annotated[list[str] | None, typer.Option(
    "--record", metavar="[SCENARIO:]TRIAL", help="Record more than a typical trial of each plan: a trial's number, "
    + ", ".join(f"{name} ({said})" for name, said in RECORDED_WORDS.items()) + "; several with commas between them, or "
    "given again.", show_default=False)]
TRIAL_METAVAR = "|".join(["N", *RECORDED_WORDS])
Rollouts = Annotated[int, typer.Option(min=1, max=MOST_ROLLOUTS,
                                       help="Noise draws; trial t has number t mod ROLLOUTS.")]
FidelityOption = Annotated[Fidelity, typer.Option(
    help="The kinematic twin alone; physics once per leg and noise draw; or every trial in physics.")]
ScenarioNames = Annotated[list[str] | None, typer.Option("--scenario", help="Only this scenario; may be repeated.",
                                                         show_default="all")]
PlanFailure = Annotated[FailureProcess | None, typer.Option(help="Failure process that plans are made for.",
                                                           show_default="the world's")]
ExecuteFailure = Annotated[FailureProcess | None, typer.Option(help="Failure process that is executed.",
                                                              show_default="the world's")]
PolicyNames = Annotated[list[str] | None, typer.Option(
    "--policy", metavar="NAME,...", help=f"What the team does about failures: {', '.join(POLICY_NAMES)}; of several, "
    "each is measured. resolve plans what is left again, exactly.", show_default="the world's")]
NewsNames = Annotated[list[str] | None, typer.Option(
    "--news", metavar="WHEN,...", help=f"When the team learns of a failure: {', '.join(NEWS)}; of several, each is "
    "measured. report: when a robot's report from its next stop is overdue; station: each robot at a station.",
    show_default=f"the world's, or {USUAL_NEWS}")]
Anticipate = Annotated[bool, typer.Option("--anticipate", help="With a policy: make a plan for the reaction too, the "
                                          "planner anticipative.")]
Calibrate = Annotated[str | None, typer.Option(
    "--calibrate", metavar="SHARE%|best", help="Make the planner calibrated too: on costs raised until at most this "
    "share of missions goes wrong though nobody fails, such as 1%; or until it is worth most under noise.",
    show_default="none")]
InteractionOption = Annotated[Interaction | None, typer.Option(
    "--interaction", help="What robots are to each other. " + "; ".join(
        f"{name}: {said}" for name, said in INTERACTIONS.items()) + ".", show_default="the world's")]
DeparturesOption = Annotated[Departures | None, typer.Option(
    "--departures", help="When robots leave that share a world. " + "; ".join(
        f"{name}: {said}" for name, said in DEPARTURES.items()) + ".", show_default="the world's")]
Out = Annotated[Path, typer.Option(metavar="DIR", help="Folder that receives the run folder.")]
AsCsv = Annotated[bool, typer.Option("--csv", help="Write the run's tables as CSV too, for spreadsheets.")]


def few_enough(count: int | None) -> int | None:
    """Refuse more worker processes than this machine can have any use for, before any work."""
    count_of(count)
    return count


WorkerCount = Annotated[int | None, typer.Option(min=1, callback=few_enough, help="Worker processes.",
                                                 show_default="all cores")]
Gap = Annotated[float, typer.Option(min=0, callback=finite, help="Relative gap at which a plan counts as optimal.")]
Force = Annotated[bool, typer.Option("--force", help="Write over a world that was edited by hand, too.")]
