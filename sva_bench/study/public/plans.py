"""Plans made and checked."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace

from sva_bench.choices import Cuts, Method, Objective, RiskKind
from sva_bench.errors import BadInput, nearest
from sva_bench.files.documents import YAML_SUFFIXES
from sva_bench.files.outputs import check_output, write_result
from sva_bench.files.pretty import pretty_json
from sva_bench.mission.certify import Certificate
from sva_bench.mission.certify import certify as check
from sva_bench.mission.instance import Instance
from sva_bench.mission.instance_file import read_instance
from sva_bench.mission.plan import Plan, unless_interrupted
from sva_bench.mission.plan_file import plan_as_dict, read_plan
from sva_bench.solver.two_stage import SolveLimits
from sva_bench.study.costs import instance_of, nominal_scenario, plan_costs
from sva_bench.study.inputs import about
from sva_bench.study.one_plan import make_plan
from sva_bench.study.plan_request import PlanRequest
from sva_bench.study.public.arguments import (
    PathLike,
    called_from_python,
    choice,
    is_a,
    number,
    optional,
    path_of,
    progress_of,
    world_given,
)
from sva_bench.workers.progress import OnProgress
from sva_bench.world.model import World


@called_from_python()
def plan(
    source: Instance | World | PathLike, *, objective: Objective = "stochastic", method: Method = "auto",
    cuts: Cuts | None = None, risk: RiskKind | None = None, beta: float | None = None, weight: float | None = None,
    target: float | None = None, scenario: str | None = None, time_limit: float | None = None, gap: float = 1e-6,
    output: PathLike | None = None, progress: OnProgress | None = None,
) -> Plan:
    """Make one plan, proved optimal unless a limit stops it: ``plan.status`` says how far it came.

    Args:
        source: An instance, a world, or the file of either (JSON, YAML).
        objective: Plan for failures (``stochastic``), or take every robot as available (``deterministic``).
        method: How it is proved; ``auto`` chooses by the instance.
        cuts: Optimality cuts of the method ``lshaped``; by default ``single``.
        risk: Plan for the worst outcomes: their mean (``cvar``), or the shortfall below a target (``excess``).
        beta: ``cvar``: the mean of the worst 1 - beta share of outcomes, 0.9 by default.
        weight: Share of the risk measure in the objective, 1 by default; the rest is the expected value.
        target: ``excess``: the value below which the shortfall counts; beyond all that can be earned, the plan is
            the stochastic one.
        scenario: Availabilities of this scenario of a world; by default those under ``robots:``.
        time_limit: Stop after so many seconds and take the best plan; none by default.
        gap: Relative gap at which a plan counts as optimal.
        output: Plan file (JSON) to write.
        progress: Called with what is being done, how much of it is done, and how much there is.

    Raises:
        UnreachableSite: If a robot cannot get from the base to a site of a ``World``; of its file, ``BadFile`` says so
            with the line.
        NeverArrives: If the figures of a robot don't let it follow a path.
        NoRoomForBerths, NoRoomForSlots: If robots that meet don't fit about base or station; of a file as above.
        BadFile, BadInput: If something is wrong with a file, or with a value, or two don't go together.
        ValueError: If an argument is of a wrong type.
        KeyboardInterrupt: On Ctrl-C; the best plan so far is not kept.

    Source:
        ``docs/model.md``; the collapsed two-stage model of the paper.
    """
    asked = PlanRequest(
        objective=choice("objective", objective, Objective), method=choice("method", method, Method),
        cuts=None if cuts is None else choice("cuts", cuts, Cuts),
        risk=None if risk is None else choice("risk", risk, RiskKind),
        beta=optional(number, "beta", beta, 0, 0.999999), weight=optional(number, "weight", weight, 0, 1),
        target=optional(number, "target", target, 0))
    limits = SolveLimits(time_limit_s=optional(number, "time_limit", time_limit, 0), gap=number("gap", gap, 0))
    told, place = progress_of(progress), None if output is None else path_of("output", output)
    if place is not None:
        check_output(place, way_out="choose another with --output")
    instance = _instance_of(source, scenario, told)
    told("solving", 0, 1)
    made = unless_interrupted(make_plan(instance, asked, limits))
    if place is not None:
        write_result(place, pretty_json(plan_as_dict(made)))
    told("solving", 1, 1)
    return made


@called_from_python()
def certify(instance: Instance | PathLike, plan: Plan | PathLike) -> Certificate:
    """Check a plan independently of any solver: is it feasible, and what is it worth?

    Args:
        instance: The instance, or its file (JSON).
        plan: The plan, or its file (JSON): ours or anybody's.

    Returns:
        The certificate: ``feasible``, ``expected`` value, fuel and time of each vehicle [s], and the ``reasons``
        of an infeasible plan.

    Raises:
        BadFile, BadInput: If something is wrong with a file, or the plan names robots or sites that aren't there.
        ValueError: If an argument is of a wrong type.

    Source:
        Constraints (1), (2), (5), (7), (9), (11) and (14a) of the paper, read as rules for a sequence of sites.
    """
    problem = instance if isinstance(instance, Instance) else read_instance(
        path_of("instance", instance, "an instance or the path of its file"))
    return check(problem, plan_given("plan", plan, problem))


def plan_given(name: str, value: object, instance: Instance) -> Plan:
    """A plan for an instance, or of a file.

    Raises:
        BadFile, BadInput: If it names vehicles or sites that the instance doesn't have.
        ValueError: If it is neither.
    """
    if not isinstance(value, Plan):
        return read_plan(path_of(name, value, "a plan or the path of its file"), instance)
    vehicles, sites = [vehicle.name for vehicle in instance.vehicles], list(instance.sites)
    for robot, route in value.routes.items():
        if robot not in vehicles:
            raise BadInput(f"{name}: there is no vehicle {robot!r}; {nearest(robot, vehicles)}")
        for site in route:
            if site not in sites:
                raise BadInput(f"{name}: {robot}: there is no site {site!r}; {nearest(site, sites)}")
    base = instance.sites[instance.base]
    at_home = {robot: () for robot, route in value.routes.items() if route in ((base,), (base, base))}  # as in a file
    return replace(value, routes={**value.routes, **at_home}) if at_home else value


def _instance_of(source: object, scenario: str | None, progress: OnProgress) -> Instance:
    if scenario is not None:
        is_a("scenario", scenario, str, "a name")
    path = None if isinstance(source, Instance | World) else path_of(
        "source", source, "an instance, a world, or the path of the file of either")
    if isinstance(source, World) or (path is not None and path.suffix.lower() in YAML_SUFFIXES):
        world, _ = world_given(source, scenario)
        with nullcontext() if path is None else about(path):
            costs = plan_costs(world, "prmstar", progress)
        return instance_of(world, costs, world.scenarios[0] if scenario else nominal_scenario(world))
    if scenario is not None:
        raise BadInput("scenario belongs to a world; an instance has its availabilities in it")
    return source if isinstance(source, Instance) else read_instance(path_of("source", source))
