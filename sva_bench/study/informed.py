"""The informed planner: in each trial the best plan for the robots that turn out to be available."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.execution.case import Case
from sva_bench.execution.executed import Executed
from sva_bench.execution.meetings import combined_meetings
from sva_bench.study.planning import InformedPlans
from sva_bench.world.model import Scenario

INFORMED = "informed"


def cases_of(scenario: Scenario, informed: InformedPlans) -> list[Case]:
    """Cases of each perfect-information plan in all trials; drives are shared between them."""
    return [Case(scenario=scenario, planner=f"{INFORMED} of {', '.join(sorted(available)) or 'none'}", plan=plan,
                 role="informed_part") for available, plan in informed.plans.items()]


def combined_trials(parts: Mapping[frozenset[str], Executed]) -> Executed:
    """The trials of the informed planner: each trial is that of the plan for its available robots.

    Args:
        parts: All trials of the plan for each set of available robots.
    """
    runs = list(parts.values())
    first_run = runs[0]
    names = np.array(first_run.robots)
    number = {available: k for k, available in enumerate(parts)}
    chosen: IntArray = np.array([number[frozenset(names[row].tolist())] for row in first_run.available])

    def pick(kind: str) -> FloatArray:
        stacked: FloatArray = np.stack([getattr(part, kind) for part in runs])
        picked: FloatArray = stacked[chosen, np.arange(len(chosen))]
        return picked

    first = runs[int(chosen[0])]
    planned = np.stack([part.planned_incentive for part in runs])[chosen]
    ends: IntArray = pick("end").astype(np.int64)
    available: BoolArray = first_run.available
    return Executed(
        case=Case(scenario=first.case.scenario, planner=INFORMED, plan=first.case.plan, role="informed"),
        robots=first.robots, rollout=first.rollout, available=available, incentive=pick("incentive"),
        lost=pick("lost").astype(np.bool_), contacts=pick("contacts").astype(np.int64),
        pois_reached=pick("pois_reached").astype(np.int64), stops_reached=pick("stops_reached").astype(np.int64),
        end=ends, end_time_s=pick("end_time_s"),
        fuel_used_s=pick("fuel_used_s"), waited_s=pick("waited_s"), planned_incentive=planned,
        drawn_value=pick("drawn_value"),
        drawn_failed=pick("drawn_failed").astype(np.bool_), terms=first_run.terms, value=pick("value"),
        margins=tuple({(margin.robot, margin.route): margin for part in runs for margin in part.margins}.values()),
        legs=tuple(dict.fromkeys(leg for k in sorted(set(chosen.tolist())) for leg in runs[k].legs)),
        traces=first.traces, meetings=combined_meetings([part.meetings for part in runs], chosen))
