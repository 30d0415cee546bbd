"""What came of executed plans, trial by trial and leg by leg: the types."""

from __future__ import annotations

from dataclasses import dataclass

from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.execution.case import Case
from sva_bench.execution.margins import Margins
from sva_bench.execution.meetings import Meetings
from sva_bench.execution.outcome import Trace, Wait
from sva_bench.execution.touch import Touch
from sva_bench.mission.failures import PlanningTerms


@dataclass(frozen=True, kw_only=True)
class LegTime:
    """A leg as planned (the repaired twin time, without margin) and as driven [s]; waits on the way are apart.

    Attributes:
        trial: The first trial that it belongs to.
        leg: Its place on the robot's route in that trial.
        touches, waits: What the robot touched on it, and where it waited.
        held_by: What it got stuck by on it, where that is known.
        cut_short: Whether the robot never reached its end: the times are of what it drove.
    """

    trial: int
    rollout: int
    robot: str
    leg: int
    origin: str
    destination: str
    planned_s: float
    driven_s: float
    waited_s: float = 0.0
    touches: tuple[Touch, ...] = ()
    waits: tuple[Wait, ...] = ()
    held_by: str = ""
    cut_short: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Executed:
    """What came of one case, trial by trial. Arrays have shape (trials, robots) unless said otherwise.

    Attributes:
        case: Plan and scenario.
        robots: Names of the robots, in order.
        rollout: Noise draw of each trial, shape (trials,).
        available: Whether the robot was never drawn to fail; of lifetimes, whether its own outlasted what it drove.
        incentive: What it collected.
        lost: Whether it failed on its way, ran out of fuel or got stuck.
        value: What it collected, less the cost of its loss.
        pois_reached, stops_reached: How far it got.
        end: Index into ``ENDS``.
        end_time_s, fuel_used_s: When it ended, and on how much.
        waited_s: How long it waited beside its stops [s].
        contacts: How many times its hull came to touch an obstacle.
        planned_incentive: What each robot's route holds, shape (robots,).
        drawn_value: What its value had been under the failures drawn alone, with each leg driven as planned.
        drawn_failed: Whether it had failed then.
        terms: The expected rewards under the failure process executed, by robot.
        margins: What fuel and time each route left under the draws that were driven; none of robots that stay home.
        legs: Every leg that was driven; none unless recorded.
        traces: The first trial over time, a trace for each robot; none unless recorded.
        meetings: What robots did to each other; ``None`` where they do not meet.
    """

    case: Case
    robots: tuple[str, ...]
    rollout: IntArray
    available: BoolArray
    incentive: FloatArray
    lost: BoolArray
    value: FloatArray
    pois_reached: IntArray
    stops_reached: IntArray
    end: IntArray
    end_time_s: FloatArray
    fuel_used_s: FloatArray
    waited_s: FloatArray
    contacts: IntArray
    planned_incentive: FloatArray
    drawn_value: FloatArray
    drawn_failed: BoolArray
    terms: PlanningTerms
    margins: tuple[Margins, ...]
    legs: tuple[LegTime, ...]
    traces: tuple[Trace, ...]
    meetings: Meetings | None = None
