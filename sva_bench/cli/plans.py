"""Commands for what solvers take and give: instances, plans, certificates."""

from __future__ import annotations

import logging
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sva_bench.choices import METHODS, Cuts, FailureProcess, Method, Objective, PathPlanner, RiskKind
from sva_bench.cli.loading import loading
from sva_bench.cli.options import (
    AsJson,
    Gap,
    MarginOption,
    PlanFailure,
    PlannerOption,
    TimeLimit,
    Verbose,
    WorldArgument,
    finite,
)
from sva_bench.cli.solving import watched_solve
from sva_bench.cli.terminal import (
    messages,
    print_hanging,
    print_json,
    progress_bars,
    refuse_closed_output,
    results,
    set_up_logging,
)
from sva_bench.errors import BadInput, ExitCode, Interrupted
from sva_bench.files.outputs import check_output, write_result
from sva_bench.files.printable import counted
from sva_bench.interrupts import deferring_ctrl_c
from sva_bench.study.plan_request import PlanRequest

if TYPE_CHECKING:
    from sva_bench.mission.instance import Instance
    from sva_bench.workers.progress import OnProgress

log = logging.getLogger(__name__)


def times(
    world: WorldArgument,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Instance file to write; default: standard "
                                                "output.", show_default=False)] = None,
    scenario: Annotated[str | None, typer.Option(help="Availabilities of this scenario; default: those under "
                                                      "robots.", show_default=False)] = None,
    planner: PlannerOption = "prmstar",
    margin: MarginOption = None,
    verbose: Verbose = False,
) -> None:
    """Plan travel times and repair them into fuel costs: an instance for any solver."""
    with loading():
        from sva_bench.mission.instance_file import instance_text

    set_up_logging(verbose)
    check_output(output, world)
    with progress_bars() as progress:
        instance = _instance_of_world(world, scenario, planner, margin, progress)
    write_result(output, instance_text(instance))


def plan(
    source: Annotated[Path, typer.Argument(metavar="WORLD-or-INSTANCE", help="World (YAML) or instance (JSON).",
                                           show_default=False)],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Plan file to write, JSON or CSV; default: "
                                                "standard output.", show_default=False)] = None,
    objective: Annotated[Objective, typer.Option(help="Plan for failures, or take every robot as "
                                                            "available.")] = "stochastic",
    method: Annotated[Method, typer.Option(help="Solution method. " + "; ".join(
        f"{name}: {text}" for name, text in METHODS.items()) + ".")] = "auto",
    cuts: Annotated[Cuts | None, typer.Option(help="Optimality cuts of lshaped.", show_default="single")] = None,
    risk: Annotated[RiskKind | None, typer.Option(help="Plan for the worst outcomes: their mean, or the shortfall "
                                                  "below a target.", show_default="none")] = None,
    beta: Annotated[float | None, typer.Option(min=0, max=0.999999, callback=finite, help="cvar: the mean of the worst "
                                               "1 - BETA share of outcomes.", show_default="0.9")] = None,
    weight: Annotated[float | None, typer.Option(min=0, max=1, callback=finite, help="Share of the risk measure in the "
                                                 "objective; the rest is the expected value.",
                                                 show_default="1")] = None,
    target: Annotated[float | None, typer.Option(min=0, callback=finite, help="excess: the value below which the "
                                                 "shortfall counts.", show_default=False)] = None,
    scenario: Annotated[str | None, typer.Option(help="Availabilities of this scenario of a world; default: those "
                                                      "under robots.", show_default=False)] = None,
    plan_failure: PlanFailure = None,
    time_limit: TimeLimit = None,
    gap: Gap = 1e-6,
    verbose: Verbose = False,
) -> None:
    """Make one plan, proved optimal unless a limit stops it."""
    with loading():
        from sva_bench.files.documents import YAML_SUFFIXES
        from sva_bench.mission.instance_file import read_instance
        from sva_bench.mission.plan_file import plan_text

    set_up_logging(verbose)
    check_output(output, source)
    request = PlanRequest(
        objective=objective, method=method, cuts=cuts, risk=risk, beta=beta, weight=weight, target=target)
    with progress_bars() as progress:
        if source.suffix.lower() in YAML_SUFFIXES:
            instance = _instance_of_world(source, scenario, "prmstar", None, progress, plan_failure)
        elif scenario is not None:
            raise BadInput("--scenario belongs to a world; an instance has its availabilities in it")
        elif plan_failure is not None:
            raise BadInput("--plan-failure belongs to a world; an instance has its process in it, under failure")
        else:
            instance = read_instance(source)
    with loading():  # after reading: what is wrong is said at once
        from sva_bench.solver.two_stage import SolveLimits
        from sva_bench.study.one_plan import make_plan

    # Ctrl-C: the solver hears it; from there on the plan is written.
    with watched_solve() as watch, deferring_ctrl_c():
        made = make_plan(instance, request, SolveLimits(time_limit_s=time_limit, gap=gap, watch=watch))
        write_result(output, plan_text(made, output))
    assert made.value is not None
    assert made.bound is not None
    gap_left = made.bound - made.value
    if gap_left > 0:
        gap_left = gap_left / abs(made.value) if made.value else math.inf  # as --gap counts it
    outcome = (f"{made.status}: value {made.value:.6g}, bound {made.bound:.6g}, relative gap {gap_left:.2g}, "
               f"{made.runtime_s:.2f} s")
    if made.status == "interrupted":
        raise Interrupted(outcome)
    messages.print(outcome, highlight=False)


def certify(
    instance: Annotated[Path, typer.Argument(metavar="INSTANCE", help="Instance file (JSON).", show_default=False)],
    plan: Annotated[Path, typer.Argument(metavar="PLAN", help="Plan file (JSON or CSV).", show_default=False)],
    as_json: AsJson = False,
) -> None:
    """Check a plan independently: is it feasible, and what is it worth?

    Exits with 3 if it is infeasible.
    """
    with loading():
        from sva_bench.mission.certify import certify as check
        from sva_bench.mission.instance_file import read_instance
        from sva_bench.mission.plan_file import read_plan

    set_up_logging(verbose=False)
    refuse_closed_output()
    problem = read_instance(instance)
    candidate = read_plan(plan, problem)
    if candidate.instance not in (None, problem.name):
        log.warning("%s was made for %s, not for %s", plan, candidate.instance, problem.name)
    certificate = check(problem, candidate)
    if as_json:
        print_json(certificate.as_dict())
    else:
        console = results()
        verdict = f"feasible, expected value {certificate.expected:.6g}" if certificate.feasible else "infeasible"
        console.print(verdict, highlight=False)
        for reason in certificate.reasons:
            print_hanging(reason, "  ")
    if not certificate.feasible:
        raise typer.Exit(ExitCode.INFEASIBLE_PLAN)


def _instance_of_world(
    path: Path, scenario: str | None, planner: PathPlanner, margin: float | None, progress: OnProgress,
    plan_failure: FailureProcess | None = None,
) -> Instance:
    """The instance of a world's scenario; of the availabilities under ``robots:`` by default."""
    with loading():
        from sva_bench.study.inputs import about, load

    world = load(path, [scenario] if scenario else None, margin, plan_failure)
    with loading():  # after the world: its errors are said at once
        from sva_bench.study.costs import instance_of, nominal_scenario, plan_costs

    with about(path):
        costs = plan_costs(world, planner, progress)
    for kind, cost in costs.items():
        messages.print(f"{kind}: {counted(cost.pairs, 'travel time')}, {cost.changed_pct:.1f} % "
                       f"repaired, by up to {cost.max_excess_pct:.1f} %", highlight=False)
    return instance_of(world, costs, world.scenarios[0] if scenario else nominal_scenario(world))
