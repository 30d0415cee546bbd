"""How tight a plan is: what noise leaves of fuel and time on each of its legs, by many draws of the twin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from sva_bench.analysis.results import Amount, PlanName
from sva_bench.arrays import BoolArray, FloatArray
from sva_bench.choices import Judgement
from sva_bench.execution.margins import Margins
from sva_bench.files.fields import Name, NonNegativeInt, Probability
from sva_bench.files.records import Record
from sva_bench.mission.instance import TOLERANCE_S

NoiseCheckFormat = Literal["sva-bench/noise-check@1"]
NOISE_CHECK: NoiseCheckFormat = "sva-bench/noise-check@1"
KNIFES_EDGE = 0.01
"""Share of draws from which on a leg that goes wrong is on a knife's edge."""
LITTLE = 0.05
"""Share of the tank, or of the mission limit, below which a leg's margin in the worst hundredth of draws is little."""


@dataclass(frozen=True, kw_only=True)
class DrivenQuantiles(Record):
    """Quantiles of a leg's driving time over draws [s]."""

    q05: Amount
    q50: Amount
    q95: Amount


@dataclass(frozen=True, kw_only=True)
class MarginQuantiles(Record):
    """Quantiles of a margin over draws [s]; ``None`` where robots don't even arrive."""

    q01: Amount | None
    q05: Amount | None


@dataclass(frozen=True, kw_only=True)
class LegTightness(Record):
    """One leg of a robot's route under noise.

    Attributes:
        robot, leg, origin, destination: Which leg: its place on the route, from 0.
        planned_s: Driving time as planned, without margin [s].
        driven_s: Driving time over draws [s]; ``None`` if it never arrives.
        fuel_margin_s, time_margin_s: Fuel and time left at the end of the leg [s]; ``None`` without a limit.
        dry, late, stuck: Share of draws in which the tank is empty before the end, the limit is over by then, and the
            robot never arrives.
        judged: What that comes to.
    """

    robot: Name
    leg: NonNegativeInt
    origin: Name
    destination: Name
    planned_s: Amount
    driven_s: DrivenQuantiles | None
    fuel_margin_s: MarginQuantiles | None
    time_margin_s: MarginQuantiles | None
    dry: Probability
    late: Probability
    stuck: Probability
    judged: Judgement

    @property
    def wrong(self) -> float:
        """Greatest share of draws in which something goes wrong on it."""
        return max(self.dry, self.late, self.stuck)


@dataclass(frozen=True, kw_only=True)
class PlanTightness(Record):
    """One plan under noise.

    Attributes:
        scenarios: The scenarios that it is the plan of.
        plan: Its name.
        bad: Share of draws in which some robot runs dry, is late or gets stuck if none fails.
        legs: Its legs, robot by robot.
    """

    scenarios: tuple[Name, ...]
    plan: PlanName
    bad: Probability
    legs: tuple[LegTightness, ...]

    @property
    def worst_first(self) -> tuple[LegTightness, ...]:
        """Legs on a knife's edge first, the worst of them before the others; then all others as they are driven."""
        return tuple(sorted(self.legs, key=lambda leg: -leg.wrong if leg.judged == "edge" else 0.0))


@dataclass(frozen=True, kw_only=True)
class NoiseCheck(Record):
    """The plans of a world under noise."""

    format: NoiseCheckFormat = NOISE_CHECK
    world: Name
    seed: NonNegativeInt
    draws: NonNegativeInt
    plans: tuple[PlanTightness, ...]


def tightness_of(
    scenarios: Sequence[str], plan: str, robots: Sequence[str], limits: Mapping[str, tuple[float, float]],
    margins: Sequence[Margins],
) -> PlanTightness:
    """How tight a plan is.

    Args:
        scenarios: What it is the plan of.
        plan: Its name.
        robots: Names of the robots, in order.
        limits: Fuel capacity and mission limit of each [s].
        margins: Margins of the robots' routes, under the same draws.
    """
    driven = [m for m in margins if len(m.leg_s)]
    wrong = [_wrong(m).any(axis=1) for m in driven]
    return PlanTightness(
        scenarios=tuple(scenarios), plan=plan, bad=float(np.mean(np.any(wrong, axis=0))) if wrong else 0.0,
        legs=tuple(_leg(robots[m.robot], m, k, limits[robots[m.robot]])
                   for m in driven for k in range(len(m.route) - 1)))


def _wrong(margins: Margins) -> BoolArray:
    """Where a draw goes wrong, shape (draws, stops); not arriving is wrong too."""
    found: BoolArray = ~((margins.fuel_s >= -TOLERANCE_S) & (margins.time_s >= -TOLERANCE_S))
    return found


def _leg(robot: str, margins: Margins, k: int, limits: tuple[float, float]) -> LegTightness:
    leg_s, fuel_s, time_s = margins.leg_s[:, k], margins.fuel_s[:, k], margins.time_s[:, k]
    arrived = ~np.isnan(leg_s)
    fuel, time = _margin(fuel_s, limits[0]), _margin(time_s, limits[1])
    shares = {"dry": float(np.mean(fuel_s < -TOLERANCE_S)), "late": float(np.mean(time_s < -TOLERANCE_S)),
              "stuck": float(np.mean(~arrived))}
    little = any(found is not None and (found.q01 is None or found.q01 < LITTLE * limit)
                 for found, limit in zip((fuel, time), limits, strict=True))
    return LegTightness(
        robot=robot, leg=k, origin=margins.route[k], destination=margins.route[k + 1],
        planned_s=float(margins.planned_s[k]), fuel_margin_s=fuel, time_margin_s=time, **shares,
        driven_s=DrivenQuantiles(**dict(zip(("q05", "q50", "q95"), np.quantile(
            leg_s[arrived], (0.05, 0.5, 0.95)).tolist(), strict=True))) if arrived.any() else None,
        judged="edge" if max(shares.values()) > KNIFES_EDGE else "close" if little else "safe")


def _margin(left_s: FloatArray, limit_s: float) -> MarginQuantiles | None:
    """Observed quantiles: what one draw in a hundred, or in twenty, falls short of."""
    if not np.isfinite(limit_s):
        return None
    low, high = np.quantile(np.where(np.isnan(left_s), -np.inf, left_s), (0.01, 0.05), method="inverted_cdf").tolist()
    return MarginQuantiles(q01=low if np.isfinite(low) else None, q05=high if np.isfinite(high) else None)
