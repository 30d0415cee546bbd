"""Teams that react: plans executed with policies, and plans made for them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Generic, Protocol, TypeVar

from sva_bench.analysis.over_trials import promise_of
from sva_bench.analysis.reaction_results import Candidate
from sva_bench.analysis.reactions import PlanReacted
from sva_bench.analysis.results import Promise
from sva_bench.choices import PolicyName
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.drives import Drives, drive_all
from sva_bench.execution.execute import drives_ahead, execute, settle_trials
from sva_bench.execution.executed import Executed
from sva_bench.execution.orders import planned_legs
from sva_bench.execution.policies.policy import Policy
from sva_bench.execution.policies.registry import POLICIES, Means
from sva_bench.execution.react import Reacted, modelled_values, react, refuse_beyond_memory
from sva_bench.mission.certify import certify, expected_value
from sva_bench.mission.instance import Instance
from sva_bench.mission.plan import Plan, unless_interrupted
from sva_bench.solver.rest import plan_rest
from sva_bench.solver.two_stage import SolveLimits, knowledge_of, plan_stochastic
from sva_bench.study.options import Options, reactions_of
from sva_bench.study.planning import unlimited
from sva_bench.study.reacting import Reaction
from sva_bench.travel.fuel import FuelCosts
from sva_bench.workers.progress import OnProgress
from sva_bench.world.model import Scenario, World

THETAS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Exponents of the survival that candidates are made for: from no failures to those of the process."""
_ELSEWHERE = 1 << 40
"""First trial of those by which candidates are judged, so that the chosen one is measured on others."""


ResultT = TypeVar("ResultT", covariant=True)


class Summing(Protocol[ResultT]):
    """What makes one result of a scenario's plans under one policy and news."""

    def __call__(self, plans: Mapping[str, PlanReacted], candidates: Sequence[Candidate], *, noisy: bool) -> ResultT:
        """The result; ``candidates`` are the plans that the anticipative one was chosen from."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ScenarioReactions(Generic[ResultT]):
    """What came of one scenario with reactions.

    Attributes:
        results: A result for each policy and news.
        reacted: Trials or histories of each plan with each of them.
    """

    results: tuple[ResultT, ...]
    reacted: tuple[Reacted, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class Stage:
    """A world's plans without reaction, and what they are executed with.

    Attributes:
        world, costs: The world and its fuel costs.
        instances: What the plans of each scenario were made for.
        executed: Their trials without reaction, all or as of ``observed``: of ``run`` both plans', of ``execute`` those
            of the plans given.
        settings: How they are executed.
        executor: Where drives run; ``None`` = here.
        drives: What was driven already; what is driven now is added.
    """

    world: World
    costs: Mapping[str, FuelCosts]
    instances: Mapping[str, Instance]
    executed: Sequence[Executed]
    settings: Settings
    executor: Executor | None
    drives: Drives


@dataclass(frozen=True, eq=False, kw_only=True)
class _Scene:
    """One scenario of a stage, with all that reactions need.

    Attributes:
        stage: The stage.
        scenario: The scenario.
        instance: Its instance under the failure process executed.
        policies: The policies by name; all plans share what was decided before.
    """

    stage: Stage
    scenario: Scenario
    instance: Instance
    policies: Mapping[PolicyName, Policy]

    def policies_of(self, cases: Iterable[Case]) -> list[Policy]:
        """The policy of each case."""
        return [self.policies[case.policy] for case in cases]

    def promise_of(self, plan: Plan) -> Promise:
        """The values of a plan before any trial; one that breaks fuel or limit has them too."""
        return promise_of(plan, expected_value(unlimited(self.instance), plan))


def react_in_scenarios(
    stage: Stage, options: Options, summed: Summing[ResultT], progress: OnProgress
) -> dict[str, ScenarioReactions[ResultT]]:
    """Execute the plans of each scenario with every reaction asked for; nothing where there is none.

    Args:
        stage: The plans and their trials without reaction.
        options: The reactions, whether plans are made for them, and when solves may stop.
        summed: Makes the result of each reaction.
        progress: Called as scenarios are done.
    """
    world, pairs = stage.world, reactions_of(stage.world, options)
    found: dict[str, ScenarioReactions[ResultT]] = {}
    for number, scenario in enumerate(world.scenarios if pairs else ()):
        progress("reacting", number, len(world.scenarios))
        instance = replace(stage.instances[scenario.name], failure=world.execute_failure)
        means = Means(instance=instance, plans_rest=plan_rest)
        scene = _Scene(stage=stage, scenario=scenario, instance=instance,
                       policies={name: POLICIES[name](means) for name in POLICIES})
        found[scenario.name] = _react(scene, pairs, options, summed)
        progress("reacting", number + 1, len(world.scenarios))
    return found


def _react(
    scene: _Scene, pairs: Sequence[Reaction], options: Options, summed: Summing[ResultT]
) -> ScenarioReactions[ResultT]:
    """Execute a scenario's plans with each policy and news."""
    stage = scene.stage
    executed = [run for run in stage.executed if run.case.scenario.name == scene.scenario.name]
    made: dict[Reaction, Anticipated] = {}
    if options.anticipate:
        drivable = [run.case for run in executed
                    if certify(scene.instance, replace(run.case.plan, value=None)).feasible]
        made = plan_for_reactions(scene, pairs, drivable, options.limits)
    ours = [run.case for run in executed]
    anticipative = {pair: Case(scenario=scene.scenario, planner="anticipative", plan=plan, role="anticipative")
                    for pair, (plan, _) in made.items()}
    # Without reaction too: by that the noise draws that were not observed are judged.
    also = observed(stage.world, stage.costs, list(anticipative.values()), stage.settings, stage.executor,
                    stage.drives)
    without = {id(case): run for case, run in zip([*ours, *anticipative.values()], [*executed, *also], strict=True)}
    cases = [(pair, case) for pair in pairs for case in [*ours, *(own for k, own in anticipative.items() if k == pair)]]
    reacting = [replace(case, policy=policy, news=news) for (policy, news), case in cases]
    kept = list({id(case): case for _, case in cases}.values())
    everything = react(stage.world, stage.costs, [*reacting, *kept], scene.policies_of([*reacting, *kept]),
                       stage.settings, stage.executor, None, stage.drives)
    idle = {id(case): run for case, run in zip(kept, everything[len(reacting):], strict=True)}
    results = []
    for pair in pairs:
        plans = {case.planner: PlanReacted(
            promise=scene.promise_of(case.plan), reacted=run, kept=idle[id(case)], executed=without[id(case)],
            trials=stage.settings.trials)
            for (whose, case), run in zip(cases, everything, strict=False) if whose == pair}
        results.append(summed(plans, made[pair][1] if pair in made else (), noisy=stage.world.noisy))
    return ScenarioReactions(results=tuple(results), reacted=tuple(everything[:len(reacting)]))


def refuse_trials_beyond_memory(
    world: World, costs: Mapping[str, FuelCosts], cases: Sequence[Case], options: Options, settings: Settings
) -> None:
    """Refuse more trials of teams that react than memory holds, where that is sure once there are plans.

    Args:
        world, costs: The world and its fuel costs.
        cases: The plans that react, with their scenarios.
        options: The reactions, and whether plans are made for them.
        settings: How they are executed.

    Raises:
        BadInput: If there are more.
    """
    pairs = reactions_of(world, options)
    if not pairs:
        return
    news = list(dict.fromkeys(heard for _, heard in pairs))
    for scenario in world.scenarios:
        own = [case for case in cases if case.scenario.name == scenario.name]
        runs = len(own) * (len(pairs) + 1) + (2 * len(pairs) if options.anticipate else 0)
        refuse_beyond_memory(world, costs, own, news, runs, settings)


def observed(
    world: World, costs: Mapping[str, FuelCosts], cases: Sequence[Case], settings: Settings,
    executor: Executor | None, drives: Drives,
) -> list[Executed]:
    """A few trials of each case without reaction, with its margins under every noise draw.

    Args:
        world, costs: The world and its fuel costs.
        cases: The cases.
        settings: As of all trials.
        executor: Where drives run; ``None`` = here.
        drives: What was driven already; what is driven now is added.
    """
    few = replace(settings, trials=min(settings.trials, settings.rollouts), recorded=False)
    if settings.fidelity == "physics" or world.meets:  # each trial, or mission, has its own drives
        return execute(world, costs, cases, few, executor, None, drives)
    ahead = drives_ahead(world, costs, cases, settings)
    wanted = dict.fromkeys(ahead.wanted, False)
    drive_all(ahead.courses.chunks(wanted, drives), drives, executor, None)
    ahead.courses.compose(wanted, drives)
    return settle_trials(world, cases, few, drives.routes, planned_legs(world, costs, cases))


Anticipated = tuple[Plan, tuple[Candidate, ...]]
"""The plan for a reaction, and all that were tried."""


def plan_for_reactions(
    scene: _Scene, pairs: Sequence[Reaction], ours: Sequence[Case], limits: SolveLimits
) -> dict[Reaction, Anticipated]:
    """The anticipative plan for each reaction: of plans that are optimal for more or less reliable robots the best.

    What is solved already isn't solved again: the deterministic plan is the one for robots that never fail, and the
    stochastic one that for robots as they are, if it was made for the failure process executed.

    Args:
        scene: The scenario.
        pairs: Policy and news of each reaction.
        ours: Both plans, which are candidates too.
        limits: When each solve may stop.
    """
    known, world = knowledge_of(scene.instance), scene.stage.world
    thetas = {"deterministic": 0.0, **({"stochastic": 1.0} if world.plan_failure == world.execute_failure else {})}
    candidates = {case.planner: (thetas.get(case.role), case.plan) for case in ours}
    solved = {_reliability(more_reliable(scene.instance, thetas[case.role])) for case in ours if case.role in thetas}
    for exponent in THETAS:
        instance = more_reliable(scene.instance, exponent)
        if _reliability(instance) not in solved:
            solved.add(_reliability(instance))
            plan = unless_interrupted(plan_stochastic(instance, limits, known=known))
            candidates[f"survival^{exponent:g}"] = exponent, plan
    distinct: dict[str, tuple[float | None, Plan]] = {}
    for name, (theta, plan) in candidates.items():
        if not any(plan.drives_like(other) for _, other in distinct.values()):
            distinct[name] = theta, plan
    stage = scene.stage
    elsewhere = replace(stage.settings, first=_ELSEWHERE, recorded=False)
    found: dict[Reaction, Anticipated] = {}
    for pair in pairs:
        policy, news = pair
        cases = [Case(scenario=scene.scenario, planner=name, plan=plan, policy=policy, news=news)
                 for name, (_, plan) in distinct.items()]
        values = modelled_values(stage.world, stage.costs, cases, scene.policies_of(cases), elsewhere)
        tried = tuple(Candidate(plan=name, theta=theta, modelled=value)
                      for (name, (theta, _)), value in zip(distinct.items(), values, strict=True))
        best = max(tried, key=lambda candidate: candidate.modelled)  # of equals the first
        chosen = replace(distinct[best.plan][1], objective="anticipative", value=best.modelled, bound=None,
                         status="feasible", details={"made_for": f"{policy} on {news} news", "candidate": best.plan})
        found[pair] = chosen, tried
    return found


def more_reliable(instance: Instance, theta: float) -> Instance:
    """The instance with every probability of survival to the power of theta; 0^0 = 1."""
    vehicles = []
    for vehicle in instance.vehicles:
        mtbf_s = vehicle.mtbf_s if vehicle.mtbf_s is None or theta == 1 else (
            vehicle.mtbf_s / theta if theta > 0 else float("inf"))
        vehicles.append(replace(vehicle, availability=vehicle.availability**theta, mtbf_s=mtbf_s))
    return replace(instance, vehicles=tuple(vehicles), joint=None)


def _reliability(instance: Instance) -> tuple[tuple[float, float | None], ...]:
    """By which instances that differ in reliability alone are told apart."""
    return tuple((vehicle.availability, vehicle.mtbf_s) for vehicle in instance.vehicles)
