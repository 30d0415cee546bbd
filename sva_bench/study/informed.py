"""The informed planner: in each trial the best plan for the robots that turn out to be available."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.errors import BadInput
from sva_bench.execution.execute import Case, Executed
from sva_bench.mission.instance import Instance
from sva_bench.mission.plan import Plan, unless_interrupted
from sva_bench.solver.outcomes import possible
from sva_bench.solver.two_stage import MOST_SUBSETS, Knowledge, SolveLimits, plan_stochastic
from sva_bench.world.model import Scenario

INFORMED = "informed"


@dataclass(frozen=True, eq=False, kw_only=True)
class InformedPlans:
    """What somebody would plan who knew beforehand who is available.

    Attributes:
        plans: The plan for each set of available robots.
        expected: Their expected value.
    """

    plans: Mapping[frozenset[str], Plan]
    expected: float


def plan_informed(instance: Instance, limits: SolveLimits, known: Knowledge, *, force: bool) -> InformedPlans:
    """The best plan for every set of robots that can be available.

    Args:
        instance: The instance; failures are those of ``mission``.
        limits: When each solve may stop.
        known: What solves of the same instance with other availabilities found.
        force: Solve however many sets there are.

    Raises:
        BadInput: If there are more than 16, and that isn't forced.
    """
    sets = possible(instance)
    if len(sets) > MOST_SUBSETS and not force:
        raise BadInput(f"{instance.name}: {len(sets)} sets of robots can be available, and the informed planner solves "
                       f"for each; beyond {MOST_SUBSETS} it has to be told so with --evpi")
    plans = {}
    for available in sets:
        sure = replace(instance, joint=None, failure="mission", vehicles=tuple(
            replace(v, availability=1.0 if v.name in available else 0.0) for v in instance.vehicles))
        plans[available] = unless_interrupted(plan_stochastic(sure, limits, known=known))
    return InformedPlans(plans=plans, expected=sum(sets[s] * (plan.value or 0.0) for s, plan in plans.items()))


def cases_of(scenario: Scenario, informed: InformedPlans) -> list[Case]:
    """Each of the plans, to be executed in all trials: drives are shared, and those not wanted are few."""
    return [Case(scenario=scenario, planner=_stem(available), plan=plan) for available, plan in informed.plans.items()]


def is_part(planner: str) -> bool:
    """Whether this is one of the plans behind the informed planner."""
    return planner.startswith(f"{INFORMED} of ")


def put_together(parts: Sequence[Executed], robots: Sequence[str]) -> Executed:
    """The trials of the informed planner: each from the plan for the robots that are available in it."""
    there = parts[0].available
    names = np.array(robots)
    drawn = [frozenset(names[row].tolist()) for row in there]
    number = {part.case.planner: k for k, part in enumerate(parts)}
    chosen: IntArray = np.array([number[_stem(available)] for available in drawn])

    def pick(kind: str) -> FloatArray:
        stacked: FloatArray = np.stack([getattr(part, kind) for part in parts])
        picked: FloatArray = stacked[chosen, np.arange(len(chosen))]
        return picked

    first = parts[int(chosen[0])]
    planned = np.stack([part.planned_incentive for part in parts])[chosen]
    ends: IntArray = pick("end").astype(np.int64)
    available: BoolArray = there
    return Executed(
        case=Case(scenario=first.case.scenario, planner=INFORMED, plan=first.case.plan), robots=first.robots,
        rollout=first.rollout, available=available, incentive=pick("incentive"),
        lost=pick("lost").astype(np.bool_), contacts=pick("contacts").astype(np.int64),
        pois_reached=pick("pois_reached").astype(np.int64), stops_reached=pick("stops_reached").astype(np.int64),
        end=ends, end_time_s=pick("end_time_s"),
        fuel_used_s=pick("fuel_used_s"), planned_incentive=planned, drawn_incentive=pick("drawn_incentive"),
        margins=tuple({(margin.robot, margin.route): margin for part in parts for margin in part.margins}.values()),
        legs=tuple(dict.fromkeys(leg for k in sorted(set(chosen.tolist())) for leg in parts[k].legs)),
        traces=first.traces)


def _stem(available: frozenset[str]) -> str:
    return f"{INFORMED} of {', '.join(sorted(available)) or 'none'}"
