"""Plan: which robot visits which sites in which order, and what was promised."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from sva_bench.errors import BadFile, nearest
from sva_bench.files.documents import Name, Number, Section, WholeNumber, dotted, pretty_json, read_json, validate
from sva_bench.files.printable import all_text
from sva_bench.mission.instance import MOST_VEHICLES, Instance

KIND = "sva-bench/plan@1"
MOST_BYTES = 20_000_000
MOST_STOPS = 10_000
"""Of a route: two thousand sites and as many visits of stations leave room."""
Objective = Literal["stochastic", "deterministic", "cvar", "excess"]
Status = Literal["optimal", "feasible", "time_limit", "interrupted"]
Route = tuple[str, ...]
"""Site names from base to base; empty for a robot that stays home."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Plan:
    """Routes, and what their maker said of them.

    Attributes:
        routes: Route of each robot, by its name.
        instance: Name of the instance it was made for.
        objective: What it was made for.
        method: How it was made.
        status: How far the solver came.
        value: What it promises, in its own objective.
        bound: Upper bound on that objective.
        fuel_s: Fuel that each robot burns [s of driving].
        runtime_s: Wall-clock time of the solve [s]; the only figure that differs between equal runs.
        seed: Seed of the method.
        details: Whatever else the maker wants to say.
    """

    routes: Mapping[str, Route]
    instance: str | None = None
    objective: Objective | None = None
    method: str | None = None
    status: Status | None = None
    value: float | None = None
    bound: float | None = None
    fuel_s: Mapping[str, float] = field(default_factory=dict)
    runtime_s: float | None = None
    seed: int | None = None
    details: Mapping[str, Any] = field(default_factory=dict)

    def route(self, robot: str) -> Route:
        """The robot's route; empty if it isn't named."""
        return self.routes.get(robot, ())

    def drives_like(self, other: Plan) -> bool:
        """Whether every robot has the same route in both: whatever happens, they collect the same."""
        return all(self.route(robot) == other.route(robot) for robot in {*self.routes, *other.routes})


def unless_interrupted(plan: Plan) -> Plan:
    """The plan; but if Ctrl-C ended its solve early, that goes on, for whom such a plan is of no use.

    Raises:
        KeyboardInterrupt: If the plan is the best until Ctrl-C.
    """
    if plan.status == "interrupted":
        raise KeyboardInterrupt
    return plan


class _PlanFile(Section):
    format: Literal["sva-bench/plan@1"]
    routes: dict[Name, list[Name]]
    instance: str | None = None
    objective: Objective | None = None
    method: str | None = None
    status: Status | None = None
    value: Number | None = None
    bound: Number | None = None
    fuel_s: dict[Name, Number] = Field(default_factory=dict)
    runtime_s: Number | None = None
    seed: WholeNumber | None = None
    details: dict[str, Any] = Field(default_factory=dict)


def read_plan(path: Path, instance: Instance) -> Plan:
    """Read a plan file for an instance.

    Raises:
        BadFile: If it is no valid plan, or names a vehicle or site that the instance doesn't have.
    """
    file = _read(path, [v.name for v in instance.vehicles], instance.sites)
    base = instance.sites[instance.base]
    stays_home = ([base], [base, base])
    routes = {robot: () if route in stays_home else tuple(route) for robot, route in file.routes.items()}
    return Plan(
        routes=routes, instance=file.instance, objective=file.objective, method=file.method, status=file.status,
        value=file.value, bound=file.bound, fuel_s=file.fuel_s, runtime_s=file.runtime_s, seed=file.seed,
        details=file.details,
    )


def read_routes(path: Path, robots: Sequence[str], sites: Sequence[str]) -> dict[str, Route]:
    """The routes of a plan file for these robots and sites, as they stand there.

    Raises:
        BadFile: As ``read_plan``.
    """
    return {robot: tuple(route) for robot, route in _read(path, robots, sites).routes.items()}


def _read(path: Path, vehicles: Sequence[str], sites: Sequence[str]) -> _PlanFile:
    """A plan file, its names and its size checked."""
    document = read_json(path, MOST_BYTES)
    routes = document.data.get("routes") if isinstance(document.data, dict) else None
    if isinstance(routes, dict) and len(routes) > MOST_VEHICLES:
        raise BadFile(path, None, "routes", f"{len(routes)} routes; at most {MOST_VEHICLES} are read")
    for robot, route in routes.items() if isinstance(routes, dict) else ():
        if isinstance(route, list) and len(route) > MOST_STOPS:
            raise BadFile(path, None, dotted(("routes", robot)), f"{len(route)} stops; at most {MOST_STOPS} are driven")
    file = validate(document, _PlanFile, KIND)
    for key in ("instance", "method", "details"):
        if not all_text(getattr(file, key)):
            raise document.error((key,), "holds half of a character that is none by itself (a lone surrogate)")
    known = set(sites)
    for robot, stops in file.routes.items():
        if robot not in vehicles:
            raise document.error(("routes", robot), f"there is no vehicle {robot!r}; {nearest(robot, list(vehicles))}")
        for k, site in enumerate(stops):
            if site not in known:
                raise document.error(("routes", robot, k), f"there is no site {site!r}; {nearest(site, list(sites))}")
    return file


def plan_as_dict(plan: Plan) -> dict[str, Any]:
    """The plan as its file's content; what is unknown is left out."""
    data: dict[str, Any] = {"format": KIND}
    if plan.instance is not None:
        data["instance"] = plan.instance
    data["routes"] = {robot: list(route) for robot, route in plan.routes.items()}
    for key in ("objective", "method", "status", "value", "bound"):
        if getattr(plan, key) is not None:
            data[key] = getattr(plan, key)
    data["fuel_s"] = {robot: fuel + 0.0 for robot, fuel in plan.fuel_s.items()}
    if plan.runtime_s is not None:
        data["runtime_s"] = plan.runtime_s
    if plan.seed is not None:
        data["seed"] = plan.seed
    data["details"] = dict(plan.details)
    return data


def write_plan(path: Path, plan: Plan) -> None:
    """Write a plan file."""
    path.write_text(pretty_json(plan_as_dict(plan)), encoding="utf-8")
