"""From plans and trials to summaries."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

from sva_bench.analysis.driving import DrivesMade, driving_told
from sva_bench.analysis.figures import difference_figure
from sva_bench.analysis.over_trials import Judged, ScenarioTrials, promise_of, scenario_summary
from sva_bench.analysis.results import Estimate, Promise, ScenarioFacts
from sva_bench.analysis.statistics import estimate
from sva_bench.analysis.summaries import ComparisonSummary, Failures, Head, Reach, Summary, Travel
from sva_bench.choices import Fault, Role
from sva_bench.execution.case import Settings
from sva_bench.execution.drives import Drives
from sva_bench.execution.executed import Executed
from sva_bench.execution.shared.players import TeamDriven
from sva_bench.mission.certify import expected_value
from sva_bench.mission.plan import Plan
from sva_bench.study.options import Options
from sva_bench.study.planning import Planned, model_is_executed, unlimited
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.model import Scenario, World

_log = logging.getLogger(__name__)

SummaryT = TypeVar("SummaryT", Summary, ComparisonSummary)


def summarise(
    world: World, options: Options, head: Head, planned: Mapping[str, Planned], executed: Sequence[Executed],
    reach: Reach,
) -> Summary:
    """The summary of a run."""
    runs: dict[tuple[str, Role], Executed] = {(run.case.scenario.name, run.case.role): run for run in executed}
    scenarios, precision = [], options.precision
    anytime: dict[str, Estimate] = {}
    for scenario in world.scenarios:
        plans = planned[scenario.name]
        trials = ScenarioTrials(
            stochastic=runs[scenario.name, "stochastic"], deterministic=runs[scenario.name, "deterministic"],
            worst=runs.get((scenario.name, "worst_tie")), calibrated=runs.get((scenario.name, "calibrated")),
            informed=None if plans.informed is None else Judged(
                expected=plans.informed.expected,
                executed=plans.informed.promised(runs[scenario.name, "informed"])))
        summed = scenario_summary(facts_of(world, scenario, plans), trials, noisy=world.noisy)
        if precision is not None and precision.anytime:
            anytime[scenario.name] = estimate(difference_figure(
                trials.stochastic, trials.deterministic, noisy=world.noisy), comparisons=precision.comparisons)
        scenarios.append(replace(summed, calibration=None if plans.calibrated is None else plans.calibrated.result))
    return Summary(**vars(head), scenarios=tuple(scenarios), reach=reach,
                   precision=None if precision is None else precision.reached(scenarios, anytime or None))


def facts_of(world: World, scenario: Scenario, plans: Planned) -> ScenarioFacts:
    """The modelled values of a scenario: each plan's closed-form value, and those of both together."""
    mission = model_is_executed(world)
    # A calibrated plan may take more than the nominal costs leave: costs at the median have no margin for it.
    truth = unlimited(replace(plans.instance, failure=world.execute_failure))

    def promise(plan: Plan) -> Promise:
        return promise_of(plan, expected_value(truth, plan))

    least, most = plans.vss_range
    return ScenarioFacts(
        name=scenario.name, availability={robot.name: scenario.availability[robot.name] for robot in world.robots},
        plans={"stochastic": promise(plans.stochastic), "deterministic": promise(plans.deterministic),
               **({} if plans.calibrated is None else {"calibrated": promise(plans.calibrated.plan)})},
        modelled_range=(least + 0.0, most + 0.0) if mission else None,
        same_plan=plans.stochastic.drives_like(plans.deterministic),
        # The collapsed model is the mean scenario's problem, so the plan for the mean is the stochastic one.
        vss_mean_value=0.0 if mission else None,
        ws=plans.ws if mission else None, evpi=plans.evpi if mission else None,
        value_of_process=plans.value_of_process)


def proved(planned: Mapping[str, Planned]) -> bool:
    """Whether all plans are proved optimal, and choices among deterministic plans that tie too."""
    return all(plan.status == "optimal" for p in planned.values() for plan in p.all_plans()) and all(
        p.ties_proved and (p.calibrated is None or p.calibrated.proved) for p in planned.values())


def head_of(world: World, settings: Settings, costs: Mapping[str, FuelCosts], *, reproducible: bool) -> Head:
    """The common head of summaries."""
    pairs = sum(cost.pairs for cost in costs.values())
    changed = sum(cost.changed_pct * cost.pairs for cost in costs.values())
    return Head(
        world=world.name, seed=settings.seed, trials=settings.trials, rollouts=settings.rollouts,
        fidelity=settings.fidelity, failure=Failures(plan=world.plan_failure, execute=world.execute_failure),
        travel=Travel(pairs=pairs, triangle_violations_pct=round(changed / pairs, 6) if pairs else 0.0,
                      max_excess_pct=round(max((c.max_excess_pct for c in costs.values()), default=0.0), 6)),
        reproducible=reproducible)


def with_drives(summary: SummaryT, drives: Drives) -> SummaryT:
    """The summary with how its drives were made."""
    made = drives_made(drives)
    _log.info("%s", driving_told(made))
    return replace(summary, drives=made)


def drives_made(drives: Drives) -> DrivesMade:
    """The figures of what was driven."""
    if drives.missions:
        return _missions_made(list(drives.missions.values()))
    made = [*drives.hops.values(), *drives.whole.values()]
    times = [float(one.leg_s.sum()) for one in made]
    total_s, physics_s = sum(times), sum(one.in_physics * time_s for one, time_s in zip(made, times, strict=True))
    checks = [100 * abs(time_s / one.twin_s - 1) for one, time_s in zip(made, times, strict=True) if one.twin_s]
    return DrivesMade(
        unit="hops" if drives.hops else "routes", count=len(made),
        in_physics_pct=min(round(100 * physics_s / total_s, 6), 100.0) if total_s > 0 else 0.0, checked=len(checks),
        worst_check_pct=round(max(checks), 6) if checks else None,
        tipped_over=sum(one.fault == "tipped over" for one in made),
        physics_failed=sum(one.fault == "physics failed" for one in made))


def _missions_made(missions: Sequence[TeamDriven]) -> DrivesMade:
    """The figures of missions of robots that share a world, which are driven as a whole."""
    times = [sum(float(driven.leg_s.sum()) for driven in mission.driven) for mission in missions]
    physics_s = sum(time_s for mission, time_s in zip(missions, times, strict=True) if mission.in_physics)
    checks = [100 * abs(time_s / mission.twin_s - 1) for mission, time_s in zip(missions, times, strict=True)
              if mission.twin_s]
    total_s = sum(times)
    return DrivesMade(
        unit="missions", count=len(missions), checked=len(checks),
        in_physics_pct=min(round(100 * physics_s / total_s, 6), 100.0) if total_s > 0 else 0.0,
        worst_check_pct=round(max(checks), 6) if checks else None,
        tipped_over=_with_fault(missions, "tipped over"), physics_failed=_with_fault(missions, "physics failed"))


def _with_fault(missions: Sequence[TeamDriven], fault: Fault) -> int:
    return sum(driven.fault == fault for mission in missions for driven in mission.driven)


def by_case(executed: Sequence[Executed]) -> dict[tuple[str, str], Executed]:
    """The executed cases by scenario and planner."""
    return {(run.case.scenario.name, run.case.planner): run for run in executed}
