"""From plans and trials to the content of ``summary.json``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from sva_bench.analysis.summary import Judged, ScenarioResult, scenario_summary
from sva_bench.execution.execute import Executed, Settings
from sva_bench.mission.certify import expected_value
from sva_bench.mission.failures import MODEL
from sva_bench.study.informed import INFORMED
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.model import World

if TYPE_CHECKING:
    from sva_bench.study.options import Options
    from sva_bench.study.planning import Planned

WORST = "deterministic, worst of its ties"


def model_is_executed(world: World) -> bool:
    """Whether failures are planned for and executed as in the two-stage model."""
    return world.plan_failure == world.execute_failure == MODEL


def summarise(
    world: World, options: Options, settings: Settings, costs: Mapping[str, FuelCosts],
    planned: Mapping[str, Planned], executed: list[Executed],
) -> dict[str, Any]:
    """The content of ``summary.json``."""
    runs = by_case(executed)
    robots = [robot.name for robot in world.robots]
    scenarios = []
    for scenario in world.scenarios:
        plans = planned[scenario.name]
        known = known_ahead(world, plans)
        judged = {name: Judged(expected=known[name], executed=runs[scenario.name, name])
                  for name in ("stochastic", "deterministic")}
        scenarios.append(scenario_summary(ScenarioResult(
            stochastic=judged["stochastic"], deterministic=judged["deterministic"],
            modelled_range=known["modelled_range"], vss_mean_value=known["vss_mean_value"],
            worst=runs.get((scenario.name, WORST)), ws=known["ws"], evpi=known["evpi"],
            value_of_process=known["value_of_process"],
            informed=None if plans.informed is None else Judged(
                expected=plans.informed.expected,
                executed=plans.informed.promised(runs[scenario.name, INFORMED])),
        ), robots, noisy=not world.noise.silent))
    summary = head(world, options, settings, costs) | {"reproducible": proved(planned), "scenarios": scenarios}
    return summary if options.precision is None else summary | {"precision": options.precision.as_dict(summary)}


def known_ahead(world: World, plans: Planned) -> dict[str, Any]:
    """What is known of a scenario's plans before any trial: each one's value in closed form, and of both together."""
    mission = model_is_executed(world)
    truth = replace(plans.instance, failure=world.execute_failure)
    return {
        "stochastic": expected_value(truth, plans.stochastic),
        "deterministic": expected_value(truth, plans.deterministic),
        "modelled_range": plans.vss_range if mission else None,
        # The collapsed model is the mean scenario's problem, so the plan for the mean is the stochastic one.
        "vss_mean_value": 0.0 if mission else None,
        "ws": plans.ws if mission else None, "evpi": plans.evpi if mission else None,
        "value_of_process": plans.value_of_process,
    }


def proved(planned: Mapping[str, Planned]) -> bool:
    """Whether no solve met a limit."""
    return all(plan.status == "optimal" for p in planned.values() for plan in p.all_plans())


def head(world: World, options: Options, settings: Settings, costs: Mapping[str, FuelCosts]) -> dict[str, Any]:
    """What every summary says first."""
    pairs = sum(cost.pairs for cost in costs.values())
    changed = sum(cost.changed_pct * cost.pairs for cost in costs.values())
    return {
        "format": "sva-bench/summary@1", "world": world.name, "seed": options.seed, "trials": settings.trials,
        "rollouts": settings.rollouts, "fidelity": settings.fidelity,
        "failure": {"plan": world.plan_failure, "execute": world.execute_failure},
        "travel": {"pairs": pairs, "triangle_violations_pct": round(changed / pairs, 6) if pairs else 0.0,
                   "max_excess_pct": round(max((c.max_excess_pct for c in costs.values()), default=0.0), 6)},
    }


def by_case(executed: list[Executed]) -> dict[tuple[str, str], Executed]:
    """What was executed, by scenario and planner: joined into one word, two cases could be one."""
    return {(run.case.scenario.name, run.case.planner): run for run in executed}
