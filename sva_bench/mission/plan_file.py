"""Plans as JSON or CSV files, from this solver or any other."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from sva_bench.choices import PlanObjective, Status
from sva_bench.errors import BadFile, nearest
from sva_bench.files.complaints import dotted
from sva_bench.files.documents import read_json, validate
from sva_bench.files.fields import Name, NonNegativeInt, Number, Section
from sva_bench.files.pretty import pretty_json
from sva_bench.files.printable import all_text, counted
from sva_bench.mission.instance import Instance
from sva_bench.mission.instance_file import MOST_VEHICLES
from sva_bench.mission.plan import Plan, Route
from sva_bench.mission.plan_csv import CSV_SUFFIX, read_rows, routes_as_csv

KIND = "sva-bench/plan@1"
MOST_BYTES = 20_000_000
MOST_STOPS = 10_000
"""Of a route: more than two thousand sites with a station after each."""


class _PlanFile(Section):
    format: Literal["sva-bench/plan@1"]
    routes: dict[Name, list[Name]]
    instance: str | None = None
    objective: PlanObjective | None = None
    method: str | None = None
    status: Status | None = None
    value: Number | None = None
    bound: Number | None = None
    fuel_s: dict[Name, Number] = Field(default_factory=dict)
    runtime_s: Number | None = None
    seed: NonNegativeInt | None = None
    details: dict[str, Any] = Field(default_factory=dict)


def read_plan(path: Path, instance: Instance) -> Plan:
    """Read a plan file for an instance: JSON, or CSV where its name ends in ``.csv``.

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
    """The routes of a plan file for these robots and sites, as written.

    Raises:
        BadFile: As ``read_plan``.
    """
    return {robot: tuple(route) for robot, route in _read(path, robots, sites).routes.items()}


def _read(path: Path, vehicles: Sequence[str], sites: Sequence[str]) -> _PlanFile:
    """A plan file, with names and size checked."""
    if path.suffix.lower() == CSV_SUFFIX:
        return _read_csv(path, vehicles, sites)
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


def _read_csv(path: Path, vehicles: Sequence[str], sites: Sequence[str]) -> _PlanFile:
    """A table of routes, with names and size checked."""
    known, robots = set(sites), set(vehicles)
    rows = read_rows(path, MOST_BYTES)
    for robot, stops in rows.items():
        if robot not in robots:
            raise BadFile(path, stops[0].line, "robot", f"there is no vehicle {robot[:64]!r}; "
                          f"{nearest(robot, list(vehicles))}")
        if len(stops) > MOST_STOPS:
            raise BadFile(path, stops[0].line, "robot", f"{robot} has {counted(len(stops), 'stop')}; at most "
                          f"{MOST_STOPS} are driven")
        for row in stops:
            if row.site not in known:
                raise BadFile(path, row.line, "site", f"there is no site {row.site[:64]!r}; "
                              f"{nearest(row.site, list(sites))}")
    return _PlanFile(format=KIND, routes={robot: [row.site for row in stops] for robot, stops in rows.items()})


def plan_as_dict(plan: Plan) -> dict[str, Any]:
    """The plan as the content of its file, without what is ``None``."""
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


def plan_text(plan: Plan, path: Path | None) -> str:
    """The plan as the content of its file: routes alone where its name ends in ``.csv``, else all of it as JSON."""
    if path is not None and path.suffix.lower() == CSV_SUFFIX:
        return routes_as_csv(plan.routes)
    return pretty_json(plan_as_dict(plan))


def write_plan(path: Path, plan: Plan) -> None:
    """Write a plan file."""
    path.write_text(pretty_json(plan_as_dict(plan)), encoding="utf-8")
