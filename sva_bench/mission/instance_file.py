"""Instances as JSON files."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field

from sva_bench.arrays import FloatArray
from sva_bench.choices import FailureProcess
from sva_bench.errors import BadFile, nearest
from sva_bench.files.documents import Document, read_json, validate
from sva_bench.files.fields import Bounded, MeanTime, Name, Probability, Rate, Section
from sva_bench.files.pretty import pretty_json
from sva_bench.files.printable import counted
from sva_bench.mission.failures import JointState, availability_by, marginals, undefined_under, without_joint
from sva_bench.mission.instance import Instance, Vehicle

KIND = "sva-bench/instance@1"
MOST_BYTES = 64_000_000
MOST_SITES, MOST_VEHICLES, MOST_STATES = 2000, 200, 10_000
MOST_COSTS = 2 * MOST_SITES**2
"""Entries of all matrices of fuel and time together: two of ``MOST_SITES`` sites, or eight of a thousand."""


class _VehicleFile(Section):
    name: Name
    fuel_capacity_s: Bounded | None
    mission_limit_s: Bounded | None
    availability: Probability | None = None
    mtbf_s: MeanTime | None = None
    loss_cost: Bounded = 0.0
    incentives: dict[Name, Bounded] = Field(default_factory=dict)
    fuel_s: list[list[Bounded | None]] | None = None
    time_s: list[list[Bounded | None]] | None = None
    idle_share: Probability = 0.0


class _JointFile(Section):
    probability: Probability
    available: list[Name]


class _InstanceFile(Section):
    format: Literal["sva-bench/instance@1"]
    name: Annotated[str, Field(min_length=1, max_length=200)]
    sites: Annotated[list[Name], Field(min_length=1)]
    base: Name
    stations: list[Name] = Field(default_factory=list)
    fuel_s: list[list[Bounded | None]] | None = None
    time_s: list[list[Bounded | None]] | None = None
    stop_s: list[Bounded] | None = None
    charge_rate: dict[Name, Rate] = Field(default_factory=dict)
    vehicles: list[_VehicleFile]
    failure: FailureProcess = "mission"
    joint_availability: Annotated[list[_JointFile], Field(min_length=1)] | None = None


def read_instance(path: Path) -> Instance:
    """Read an instance file.

    Raises:
        BadFile: If it is no valid instance; with line and key.
    """
    document = read_json(path, MOST_BYTES)
    _refuse_too_large(path, document.data)
    file = validate(document, _InstanceFile, KIND)
    sites = tuple(file.sites)
    _refuse_duplicates(document, ("sites",), sites)
    _refuse_duplicates(document, ("stations",), file.stations)
    for loc, name in ((("base",), file.base), *((("stations", k), name) for k, name in enumerate(file.stations))):
        if name not in sites:
            raise document.error(loc, f"{name!r} is not among the sites; {nearest(name, list(sites))}")
    if file.base in file.stations:
        raise document.error(("stations",), f"the base {file.base!r} is listed here; vehicles never refuel there")
    if file.stop_s is not None and len(file.stop_s) != len(sites):
        raise document.error(("stop_s",), f"expected {counted(len(sites), 'entry', 'entries')}, one for each site, "
                             f"found {len(file.stop_s)}")
    common = _Costs(*(None if rows is None else _matrix(document, (key,), rows, len(sites))
                      for key, rows in (("fuel_s", file.fuel_s), ("time_s", file.time_s))))
    _refuse_duplicates(document, ("vehicles",), [v.name for v in file.vehicles])
    joint = _joint(document, file)
    if joint is not None and (other := without_joint([file.failure])):
        raise document.error(("joint_availability",), f"under {other} vehicles fail independently; leave it out, or "
                             "choose another failure process")
    vehicles = tuple(_vehicle(document, k, v, file, common, joint) for k, v in enumerate(file.vehicles))
    return Instance(
        name=file.name, sites=sites, base=sites.index(file.base), stations=tuple(sites.index(r) for r in file.stations),
        stop_s=np.array(file.stop_s if file.stop_s is not None else [0.0] * len(sites)), vehicles=vehicles,
        failure=file.failure, joint=joint, charge_rate=_charge_rates(document, file),
    )


class _Costs(NamedTuple):
    """The matrices that vehicles without their own have in common."""

    fuel_s: FloatArray | None
    time_s: FloatArray | None


def _charge_rates(document: Document, file: _InstanceFile) -> FloatArray | None:
    """Charge rate of each site, shape (n,); ``None`` where none is given."""
    rates = np.full(len(file.sites), math.inf)
    for name, rate in file.charge_rate.items():
        if name not in file.stations:
            raise document.error(("charge_rate", name), f"{name!r} is no station; {nearest(name, file.stations)}")
        rates[file.sites.index(name)] = rate
    return rates if file.charge_rate else None


def _refuse_too_large(path: Path, data: Any) -> None:
    """Refuse an instance beyond the size limits before it is validated entry by entry; without line numbers."""
    if not isinstance(data, dict):
        return
    vehicles: Any = data.get("vehicles") if isinstance(data.get("vehicles"), list) else []
    joint: Any = data.get("joint_availability")
    for key, items, most in (("sites", data.get("sites"), MOST_SITES), ("stations", data.get("stations"), MOST_SITES),
                             ("stop_s", data.get("stop_s"), MOST_SITES),
                             ("charge_rate", data.get("charge_rate"), MOST_SITES),
                             ("vehicles", vehicles, MOST_VEHICLES), ("joint_availability", joint, MOST_STATES),
                             *((f"joint_availability[{k}].available", state.get("available"), MOST_VEHICLES)
                               for k, state in enumerate(joint[:MOST_STATES] if isinstance(joint, list) else ())
                               if isinstance(state, dict)),
                             *((f"vehicles[{k}].incentives", vehicle.get("incentives"), MOST_SITES)
                               for k, vehicle in enumerate(vehicles[:MOST_VEHICLES]) if isinstance(vehicle, dict))):
        if isinstance(items, list | dict) and len(items) > most:
            raise BadFile(path, None, key, f"{len(items)} entries; at most {most} are read")
    costs = 0
    for holder in (data, *(vehicle for vehicle in vehicles if isinstance(vehicle, dict))):
        for key in ("fuel_s", "time_s"):
            rows = holder.get(key)
            lengths = [len(row) for row in rows if isinstance(row, list)] if isinstance(rows, list) else []
            longest = max([len(lengths), *lengths])
            if longest > MOST_SITES:
                raise BadFile(path, None, key, f"a row or a column of {longest} entries; at most {MOST_SITES} "
                              "are read")
            costs += sum(lengths)
    if costs > MOST_COSTS:
        raise BadFile(path, None, "fuel_s", f"{costs} costs in all; at most {MOST_COSTS} are read")


def _vehicle(
    document: Document, number: int, file: _VehicleFile, instance: _InstanceFile,
    common: _Costs, joint: tuple[JointState, ...] | None,
) -> Vehicle:
    loc = ("vehicles", number)
    sites, pois = instance.sites, set(instance.sites) - {instance.base, *instance.stations}
    incentives = np.zeros(len(sites))
    for poi, value in file.incentives.items():
        if poi not in pois:
            raise document.error((*loc, "incentives", poi), f"{poi!r} is no POI; {nearest(poi, sorted(pois))}")
        incentives[sites.index(poi)] = value
    fuel = common.fuel_s if file.fuel_s is None else _matrix(document, (*loc, "fuel_s"), file.fuel_s, len(sites))
    if fuel is None:
        raise document.error(loc, "there is no fuel_s, neither here nor for the whole instance; add one")
    time = common.time_s if file.time_s is None else _matrix(document, (*loc, "time_s"), file.time_s, len(sites))
    if time is not None and len(other := np.argwhere(np.isinf(time) != np.isinf(fuel))):
        i, j = (int(k) for k in other[0])
        where = (*loc, "time_s", i, j) if file.time_s is not None else ("time_s", i, j)
        raise document.error(where, f"the leg {sites[i]} -> {sites[j]} of {file.name} is null in one of fuel_s and "
                             "time_s alone; give both, or neither")
    availability = file.availability
    if joint is not None:
        marginal = marginals(joint, [file.name])[file.name]
        if availability is not None and abs(availability - marginal) > 1e-9:
            raise document.error((*loc, "availability"),
                                 f"{availability} is not the marginal of joint_availability, {marginal}; drop it")
        availability = marginal
    limit_s = math.inf if file.mission_limit_s is None else file.mission_limit_s
    if availability is None:
        if file.mtbf_s is None:
            if "availability" in file.model_fields_set:
                raise document.error((*loc, "availability"), "expected a probability, found null")
            raise document.error(loc, "the key 'availability' is missing; add it")
        availability = availability_by(file.mtbf_s, limit_s)
    vehicle = Vehicle(
        name=file.name, incentives=incentives, fuel_s=fuel, availability=availability,
        fuel_capacity_s=math.inf if file.fuel_capacity_s is None else file.fuel_capacity_s,
        mission_limit_s=limit_s, mtbf_s=file.mtbf_s, loss_cost=file.loss_cost,
        idle_share=file.idle_share, time_s=time,
    )
    if problem := undefined_under([instance.failure], vehicle.reliability):
        raise document.error((*loc, "availability"), f"{problem} of the vehicle")
    return vehicle


def _matrix(document: Document, loc: tuple[str | int, ...], rows: list[list[float | None]], n: int) -> FloatArray:
    if len(rows) != n:
        raise document.error(loc, f"expected {counted(n, 'row')}, one for each site, found {len(rows)}")
    for i, row in enumerate(rows):
        if len(row) != n:
            raise document.error((*loc, i), f"expected {counted(n, 'entry', 'entries')}, one for each site, "
                                 f"found {len(row)}")
        if row[i] not in (0, None):
            raise document.error((*loc, i, i), f"the diagonal must be 0, found {row[i]}")
    matrix = np.array([[math.inf if cost is None else cost for cost in row] for row in rows], dtype=np.float64)
    np.fill_diagonal(matrix, 0.0)
    return matrix


def _joint(document: Document, file: _InstanceFile) -> tuple[JointState, ...] | None:
    if file.joint_availability is None:
        return None
    names = [v.name for v in file.vehicles]
    for k, state in enumerate(file.joint_availability):
        for i, name in enumerate(state.available):
            if name not in names:
                raise document.error(("joint_availability", k, "available", i),
                                     f"{name!r} is no vehicle; {nearest(name, names)}")
    total = sum(state.probability for state in file.joint_availability)
    if abs(total - 1) > 1e-9:
        raise document.error(("joint_availability",), f"the probabilities add up to {total:.12g}, not to 1")
    return tuple(
        JointState(probability=s.probability, available=frozenset(s.available)) for s in file.joint_availability)


def _refuse_duplicates(document: Document, loc: tuple[str | int, ...], names: Sequence[str]) -> None:
    seen: set[str] = set()
    for k, name in enumerate(names):
        if name in seen:
            raise document.error((*loc, k), f"{name!r} is a duplicate; names must differ")
        seen.add(name)


def instance_as_dict(instance: Instance) -> dict[str, Any]:
    """The instance as the content of its file."""
    n = len(instance.sites)
    shared = {key: _are_shared([getattr(v, key) for v in instance.vehicles]) for key in ("fuel_s", "time_s")}
    data: dict[str, Any] = {
        "format": KIND, "name": instance.name, "sites": list(instance.sites), "base": instance.sites[instance.base],
        "stations": [instance.sites[r] for r in instance.stations],
    }
    for key in ("fuel_s", "time_s"):
        if shared[key]:
            data[key] = _rows(getattr(instance.vehicles[0], key))
    data["stop_s"] = [_plain(x) for x in instance.stop_s]
    if instance.charge_rate is not None:
        data["charge_rate"] = {instance.sites[r]: _plain(instance.charge_rate[r]) for r in instance.stations
                               if np.isfinite(instance.charge_rate[r])}
    data["vehicles"] = []
    for v in instance.vehicles:
        entry: dict[str, Any] = {
            "name": v.name, "fuel_capacity_s": _plain(v.fuel_capacity_s), "mission_limit_s": _plain(v.mission_limit_s),
            "availability": _plain(v.availability),
            # A mean of infinity is what an availability of 1 says too.
            **({"mtbf_s": _plain(v.mtbf_s)} if v.mtbf_s is not None and math.isfinite(v.mtbf_s) else {}),
            **({"loss_cost": _plain(v.loss_cost)} if v.loss_cost else {}),
            **({"idle_share": _plain(v.idle_share)} if v.idle_share else {}),
            "incentives": {instance.sites[j]: _plain(v.incentives[j]) for j in range(n) if v.incentives[j] > 0},
        }
        for key in ("fuel_s", "time_s"):
            if not shared[key] and (costs := getattr(v, key)) is not None:
                entry[key] = _rows(costs)
        data["vehicles"].append(entry)
    data["failure"] = instance.failure
    if instance.joint is not None:
        data["joint_availability"] = [
            {"probability": s.probability, "available": sorted(s.available)} for s in instance.joint]
    return data


def _are_shared(matrices: Sequence[FloatArray | None]) -> bool:
    """Whether all vehicles have the same matrix."""
    return any(one is not None and all(other is not None and np.array_equal(one, other) for other in matrices)
               for one in matrices[:1])


def write_instance(path: Path, instance: Instance) -> None:
    """Write an instance file."""
    path.write_text(instance_text(instance), encoding="utf-8")


def instance_text(instance: Instance) -> str:
    """The text of an instance file, with each matrix row on a line."""
    return pretty_json(instance_as_dict(instance))


def _rows(matrix: FloatArray) -> list[list[float | None]]:
    return [[_plain(x) for x in row] for row in matrix]


def _plain(value: float) -> float | None:
    return float(value) + 0.0 if math.isfinite(value) else None  # + 0.0: writes -0.0 as 0.0
