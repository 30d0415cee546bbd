"""Random shared missions: robots of several sizes in rooms, aisles, a field, a maze or behind narrow doors."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from sva_bench.errors import BadInput, SvaBenchError
from sva_bench.execution.case import Case
from sva_bench.execution.orders import orders_of, planned_legs
from sva_bench.execution.outcome import Assignment
from sva_bench.files.documents import parse_yaml
from sva_bench.generate.terrain import DENSITY, random_places, random_terrain
from sva_bench.mission.plan import Plan, Route
from sva_bench.study.costs import plan_costs
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.load import obstacles_of, world_of
from sva_bench.world.model import World
from sva_bench.world.places import Places
from sva_bench.world.schema import Shapes

Family = Literal["rooms", "aisles", "field", "maze", "doors"]
FAMILIES: tuple[Family, ...] = ("rooms", "aisles", "field", "maze", "doors")


@dataclass(frozen=True, eq=False, kw_only=True)
class Ready:
    """A world and a plan, ready to be executed."""

    world: World
    costs: Mapping[str, FuelCosts]
    case: Case
    orders: tuple[Assignment, ...]


def random_mission(seed: int, *, interaction: str = "shared", family: Family | None = None, robots: int | None = None,
                   noisy: bool | None = None, process: str | None = None) -> Ready | None:
    """A mission by its seed; ``None`` if the robots don't fit into the world drawn."""
    rng = np.random.default_rng([61, seed])
    family = family or FAMILIES[seed % len(FAMILIES)]
    count = robots or int(rng.integers(2, 7))
    size_m = float(rng.integers(8, 15))
    try:
        shapes, places = _terrain(family, size_m, seed, int(rng.integers(max(4, count), 15)), int(rng.integers(0, 3)))
    except BadInput:
        return None
    models = ("turtlebot2", "turtlebot2", "turtlebot3_burger", "turtlebot3_waffle", "create3",
              {"like": "turtlebot2", "radius_m": 0.2, "max_speed_m_s": 0.5})
    noise = _noise(rng) if noisy is None or noisy else {}
    stations = {f"r{k + 1}": {"at_m": list(place), "stop_s": float(rng.integers(0, 20)),
                              **({"charge_rate": 4} if rng.random() < 0.4 else {}),
                              **({"slots": 2} if rng.random() < 0.3 else {})}
                for k, place in enumerate(places.stations)}
    passages = _passages(rng, family, size_m, places) if noise or noisy is None else {}
    document = {
        "format": "sva-bench/world@1", "name": f"random-{seed}", "interaction": interaction, "noise": noise,
        "passages": passages,
        "map": {"shapes": {"bounds_m": [0, 0, size_m, size_m], "obstacles": shapes}},
        "sites": {"base": {"at_m": list(places.base)}, "stations": stations,
                  "pois": {f"p{k + 1}": {"at_m": list(place), "stop_s": float(rng.integers(0, 6))}
                           for k, place in enumerate(places.pois)}},
        "robots": {f"uv{k + 1}": {
            "model": models[int(rng.integers(len(models)))], "availability": float(rng.uniform(0.4, 1)),
            "mission_limit_s": 900, "mtbf_s": 400, "idle_share": float(rng.choice([0, 0.2])),
            "fuel_capacity_s": float(rng.choice([60, 150, 1000])),
            "incentives": {f"p{i + 1}": 10 for i in range(len(places.pois))}} for k in range(count)},
        "failure": process or str(rng.choice(["mission", "per_leg", "hazard"]))}
    try:
        world, costs = _planned(document)
    except SvaBenchError:
        return None
    pois = [poi.name for poi in world.pois]
    rng.shuffle(pois)
    routes: dict[str, Route] = {}
    for k, robot in enumerate(world.robots):
        stops = pois[k::count][:8]
        if stations and rng.random() < 0.6:
            stops.insert(int(rng.integers(len(stops) + 1)), str(rng.choice(list(stations))))
        routes[robot.name] = ("base", *stops, "base") if stops else ()
    return _ready(world, costs, routes)


def mission_in(document: Mapping[str, Any], routes: Mapping[str, Route]) -> Ready:
    """A mission in a world by what its file says, but for format and name."""
    world, costs = _planned({"format": "sva-bench/world@1", "name": "test", "interaction": "shared", **document})
    return _ready(world, costs, routes)


def _planned(document: Mapping[str, Any]) -> tuple[World, Mapping[str, FuelCosts]]:
    world = world_of(parse_yaml(json.dumps(document), Path(f"{document['name']}.yaml")))
    return world, plan_costs(world, "prmstar", lambda *_: None)


def _ready(world: World, costs: Mapping[str, FuelCosts], routes: Mapping[str, Route]) -> Ready:
    case = Case(scenario=world.scenarios[0], planner="test", plan=Plan(routes=dict(routes)))
    return Ready(world=world, costs=costs, case=case,
                 orders=tuple(orders_of(world, case, planned_legs(world, costs, [case]))))


def _noise(rng: np.random.Generator) -> dict[str, Any]:
    """All noise, all but localisation, little or none; people make robots wait anywhere."""
    noise: dict[str, Any] = {"preset": "realistic"}
    match int(rng.integers(4)):
        case 0:
            return {}
        case 1:
            noise["localisation"] = None
        case 2:
            noise["localisation"] = {"sd_m": float(rng.uniform(0.01, 0.08)), "length_m": float(rng.uniform(0.3, 2))}
    if rng.random() < 0.5:
        noise["people"] = {"per_m": 0.03, "stop_s": 4}
    return noise


def _passages(rng: np.random.Generator, family: Family, size_m: float, places: Places) -> dict[str, Any]:
    """A passage that is often shut: the narrow door, or a line between two sites; or none."""
    if rng.random() < 0.5:
        return {}
    ends = [[size_m / 2, size_m / 2 - 0.6], [size_m / 2, size_m / 2 + 0.6]]
    if family != "doors":
        ends = [list(place) for place in places.pois[:2]]
    return {"gate": {"at_m": ends, "blocked": 0.5, "wait_s": float(rng.integers(3, 25))}}


def _terrain(family: Family, size_m: float, seed: int, pois: int, stations: int) -> tuple[list[Any], Places]:
    """Obstacles and places; two rooms with a narrow door are no family of the generator."""
    if family != "doors":
        terrain = random_terrain(family, size_m=size_m, density=DENSITY[family], seed=seed)
        return [dict(shape) for shape in terrain.shapes], random_places(
            terrain.obstacles, stations=stations, pois=pois, seed=seed)
    side = (size_m - (0.7 if seed % 2 else 0.95)) / 2
    shapes = [{"box": [size_m / 2, y], "size_m": [0.2, side]} for y in (side / 2, size_m - side / 2)]
    obstacles = obstacles_of(Shapes.model_validate({"bounds_m": [0, 0, size_m, size_m], "obstacles": shapes}))
    return shapes, random_places(obstacles, stations=stations, pois=pois, seed=seed)
