"""Certificates: whether a plan is feasible, and its value, from the instance alone.

Shares no code with the solver, so it also detects the solver's errors.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from typing import Any

from sva_bench.files.notebook import notebook_table
from sva_bench.mission.failures import RouteProfile, process_of
from sva_bench.mission.instance import TOLERANCE_S, Instance, Vehicle
from sva_bench.mission.plan import Plan, Route

INFINITE = float("inf")
VALUE_TOLERANCE = 1e-6  # relative; the default gap of solves


@dataclass(frozen=True, kw_only=True)
class Certificate:
    """The result of an independent check of a plan.

    Attributes:
        feasible: Whether every vehicle can drive its route within its fuel and limit, and no POI is visited twice.
        expected: Expected value, which is incentive less the cost of lost vehicles, under the instance's failure
            process; ``None`` if infeasible.
        nominal: Incentive if every vehicle is available; ``None`` if infeasible.
        fuel_s: Fuel that each vehicle burns, driving and in stops at POIs [s of driving]; ``inf`` if a leg does not
            exist.
        duration_s: Mission clock of each vehicle at its end: driving, stops and charging [s].
        reasons: Why it is infeasible; of a feasible plan, which of its claims are wrong.
    """

    feasible: bool
    expected: float | None
    nominal: float | None
    fuel_s: dict[str, float]
    duration_s: dict[str, float]
    reasons: tuple[str, ...]

    def __repr__(self) -> str:
        said = "" if not self.reasons else f": {self.reasons[0]}" + (
            "" if len(self.reasons) == 1 else f" (and {len(self.reasons) - 1} more)")
        return f"Certificate({self._verdict()}{said})"

    def _repr_html_(self) -> str:
        """A notebook's table: a row for each vehicle, and for each reason."""
        vehicles = [(name, f"{fuel:.1f}", f"{self.duration_s[name]:.1f}") for name, fuel in self.fuel_s.items()]
        return notebook_table(self._verdict(), ("vehicle", "fuel [s]", "mission [s]"),
                              [*vehicles, *((reason, "", "") for reason in self.reasons)])

    def _verdict(self) -> str:
        return "infeasible" if self.expected is None else \
            f"feasible, expected value {self.expected:.6g}, {self.nominal:.6g} if all are available"

    def as_dict(self) -> dict[str, Any]:
        """The certificate as ``sva-bench certify --json`` prints it."""
        return {"format": "sva-bench/certificate@1", "feasible": self.feasible, "expected": self.expected,
                "reasons": list(self.reasons)}


def certify(instance: Instance, plan: Plan) -> Certificate:
    """The certificate of a plan for an instance.

    Args:
        instance: The instance.
        plan: The plan; its vehicles and sites must be the instance's.

    Source:
        Constraints (1), (2), (5), (7), (9), (11) and (14a) of the paper, read as rules for a sequence of sites.
    """
    reasons: list[str] = []
    visited: dict[str, str] = {}
    fuel, duration = {}, {}
    expected = nominal = 0.0
    process = process_of(instance.failure)
    for vehicle in instance.vehicles:
        route = plan.route(vehicle.name)
        fuel[vehicle.name], duration[vehicle.name] = _drive(instance, vehicle, route, reasons)
        earned, arrival, driving_s = [], [], _driving_times(instance, vehicle, route)
        for number, name in enumerate(route):
            site = instance.sites.index(name)
            if site == instance.base or site in instance.stations:
                continue
            if name in visited:
                reason = f"{vehicle.name}: POI {name!r} is visited twice; name it once" \
                    if visited[name] == vehicle.name else \
                    f"{vehicle.name}: POI {name!r} is visited already, by {visited[name]!r}; leave it to one of them"
                reasons += [reason] if reason not in reasons else []
            visited[name] = vehicle.name
            earned.append(float(vehicle.incentives[site]))
            arrival.append(driving_s[number])
        expected += process.route_value(
            RouteProfile(incentives=tuple(earned), arrival_s=tuple(arrival),
                         home_s=driving_s[-1] if driving_s else 0.0),
            vehicle.reliability)
        nominal += sum(earned)
    if reasons:
        return Certificate(feasible=False, expected=None, nominal=None, fuel_s=fuel, duration_s=duration,
                           reasons=tuple(reasons))
    claims = _wrong_claims(plan, expected, nominal, fuel)
    return Certificate(feasible=True, expected=expected + 0.0, nominal=nominal + 0.0, fuel_s=fuel, duration_s=duration,
                       reasons=tuple(claims))


def _drive(instance: Instance, vehicle: Vehicle, route: Route, reasons: list[str]) -> tuple[float, float]:
    """Fuel burnt and duration of a route [s]; violations are appended to ``reasons``."""
    if not route:
        return 0.0, 0.0
    sites = [instance.sites.index(name) for name in route]
    name = vehicle.name
    if sites[0] != instance.base or sites[-1] != instance.base or len(sites) < 2:
        reasons.append(f"{name}: the route must start and end at the base, {instance.sites[instance.base]!r}")
    if instance.base in sites[1:-1]:
        reasons.append(f"{name}: the base is an intermediate stop of the route; it is left and entered once")
    since_refuel = to_charge = fuel = duration = 0.0
    clock_s = vehicle.fuel_s if vehicle.time_s is None else vehicle.time_s
    for i, j in itertools.pairwise(sites):
        leg = float(vehicle.fuel_s[i, j])
        where = f"{instance.sites[i]!r} -> {instance.sites[j]!r}"
        if i == j:  # repeated POIs, and the base as an intermediate stop, have messages of their own
            if i in instance.stations or len(sites) == 2:
                reasons.append(f"{name}: {instance.sites[i]!r} follows itself; name a stop once")
        elif leg == INFINITE:
            reasons.append(f"{name}: there is no leg {where}")
        since_refuel += leg
        to_charge += leg
        fuel += leg
        duration += float(clock_s[i, j]) + float(instance.stop_s[j])
        if INFINITE > since_refuel > vehicle.fuel_capacity_s + TOLERANCE_S:
            reasons.append(f"{name}: {since_refuel:.3f} s of fuel burnt on arrival over {where}; "
                           f"the capacity is {vehicle.fuel_capacity_s:.3f} s")
            since_refuel = 0.0  # one message for each refuel interval
        if j in instance.stations:
            if instance.charge_rate is not None and instance.charge_rate[j] < INFINITE:
                duration += to_charge / float(instance.charge_rate[j])
            since_refuel = to_charge = 0.0
        elif j != instance.base:
            idle = vehicle.idle_share * float(instance.stop_s[j])
            since_refuel += idle
            to_charge += idle
            fuel += idle
    if duration > vehicle.mission_limit_s + TOLERANCE_S:
        reasons.append(f"{name}: the mission takes {duration:.3f} s; the limit is {vehicle.mission_limit_s:.3f} s")
    return fuel, duration


def _driving_times(instance: Instance, vehicle: Vehicle, route: Route) -> list[float]:
    """Driving time until each stop of a route [s]: that of ``fuel_s``, without stops."""
    sites = [instance.sites.index(name) for name in route]
    legs = (float(vehicle.fuel_s[i, j]) for i, j in itertools.pairwise(sites))
    return list(itertools.accumulate(legs, initial=0.0)) if route else []


def _wrong_claims(plan: Plan, expected: float, nominal: float, fuel: dict[str, float]) -> list[str]:
    """The claims of a plan, of value and fuel, that the check refutes."""
    claims = []
    true_value = nominal if plan.objective == "deterministic" else expected
    if plan.value is not None and plan.objective in ("stochastic", "deterministic") and \
            abs(plan.value - true_value) > VALUE_TOLERANCE * abs(true_value):
        claims.append(f"the plan claims a value of {plan.value:.6g}; it is worth {true_value:.6g}")
    claims += [f"{name}: the plan claims {claimed:.3f} s of fuel; it burns {fuel[name]:.3f} s"
               for name, claimed in plan.fuel_s.items() if name in fuel and abs(claimed - fuel[name]) > TOLERANCE_S]
    return claims


def expected_value(instance: Instance, plan: Plan) -> float:
    """Closed-form value of a plan under the instance's failure process, by the independent check.

    Raises:
        RuntimeError: If the plan is infeasible.
    """
    certificate = certify(instance, replace(plan, value=None))
    if certificate.expected is None:
        raise RuntimeError(f"a plan for {instance.name} fails its check: {'; '.join(certificate.reasons)}")
    return certificate.expected
