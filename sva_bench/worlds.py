"""New world files: terrain and sites, a mission proposed for them, and all of it checked."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from sva_bench.documents import Loc, parse_yaml, pretty_yaml
from sva_bench.errors import BadInput
from sva_bench.interrupts import holding_back_ctrl_c
from sva_bench.world.generate import DENSITY, Family, Point, random_places, random_terrain
from sva_bench.world.load import world_of
from sva_bench.world.schema import KIND

STATION_STOP_S = 10
"""Time that refuelling takes, as in the shipped worlds."""

WHEEL_GAIN_SD = 0.01
"""Noise, as in the shipped worlds."""

_FIRST_WORDS: dict[Family, str] = {
    "rooms": "Rooms joined by doors", "field": "A field with scattered obstacles", "aisles": "Aisles between racks",
    "maze": "A maze"}

_SPACED: tuple[Loc, ...] = (("map",), ("sites",), ("robots",), ("scenarios",), ("failure",))

Progress = Callable[[str, int, int], None]


def random_world(
    family: Family, *, size_m: float, density: float | None, pois: int, stations: int, robots: int, seed: int,
    progress: Progress,
) -> str:
    """The text of a random world's file: the same for the same arguments.

    Args:
        family: What stands there.
        size_m: Side of the square.
        density: How full it is (``random_terrain``); default: the family's.
        pois, stations, robots: How many of each.
        seed: Seed of everything.
        progress: Told how far it is.

    Raises:
        BadInput: If it does not fit.
    """
    if pois < 2 * robots:
        raise BadInput(f"{robots} robots and {pois} POIs leave nothing to decide; choose two POIs for each robot at "
                       "least")
    full = DENSITY[family] if density is None else density
    terrain = random_terrain(family, size_m=size_m, density=full, seed=seed)
    places = random_places(terrain.obstacles, stations=stations, pois=pois, seed=seed)
    others = [f"d{full:g}"] * (full != DENSITY[family]) + [f"k{stations}"] * (stations != 5)
    name = "-".join([family, f"{size_m:g}m", *others, f"n{pois}", f"m{robots}", f"s{seed}"])
    remarks: dict[Loc, str] = {
        (): f"{_FIRST_WORDS[family]}, drawn at random: "
            f"sva-bench world random --family {family} --size {size_m:g} --density {full:g}\n"
            f"--pois {pois} --stations {stations} --robots {robots} --seed {seed}"}
    remarks |= {("map", "shapes", "obstacles", number): text for number, text in terrain.remarks.items()}
    data = {"map": {"shapes": {"bounds_m": [_plain(x) for x in terrain.bounds_m],
                               "obstacles": [dict(shape) for shape in terrain.shapes]}},
            "sites": sites_section(places.base, places.stations, places.pois)}
    return with_mission(name, data, remarks, robots=robots, seed=seed, path=Path(f"{name}.yaml"), progress=progress)


def sites_section(base: Point, stations: tuple[Point, ...], pois: tuple[Point, ...]) -> dict[str, Any]:
    """The section ``sites`` of a world file, with names as in the shipped worlds."""
    return {
        "base": {"at_m": list(base)},
        "stations": {f"r{k}": {"at_m": list(at), "stop_s": STATION_STOP_S} for k, at in enumerate(stations, start=1)},
        "pois": {f"p{k}": {"at_m": list(at)} for k, at in enumerate(pois, start=1)}}


def with_mission(
    name: str, data: Mapping[str, Any], remarks: Mapping[Loc, str], *, robots: int, seed: int, path: Path,
    progress: Progress,
) -> str:
    """The text of a world file whose map and sites are given, with a mission that suits them.

    Args:
        name: The world's name.
        data: The sections ``map`` and ``sites``.
        remarks: What to say above them.
        robots: Number of robots.
        seed: Seed of the mission.
        path: Where the file will be: files that it names are found from there.
        progress: Told how far it is.

    Raises:
        BadFile: If map and sites make no good world.
        UnreachableSite: If a site can't be reached.
        BadInput: If there are too few robots or POIs for a mission.
    """
    with holding_back_ctrl_c():  # after terrain and sites: what does not fit is said at once
        from sva_bench.bench import plan_costs
        from sva_bench.proposal import MODEL, propose_mission

    head = {"format": KIND, "name": name, **data}
    bare = world_of(parse_yaml(pretty_yaml({**head, "robots": {"uv1": {"model": MODEL, "incentives": {}}}}, {}), path))
    (costs,) = plan_costs(bare, "prmstar", progress).values()
    progress("choosing a mission", 0, 1)
    proposal = propose_mission(bare.sites, costs.cost_s, robots=robots, seed=seed)
    progress("choosing a mission", 1, 1)
    text = pretty_yaml(
        {**head, **proposal.sections(), "failure": "mission", "margin": bare.margin,
         "noise": {"wheel_gain_sd": WHEEL_GAIN_SD}},
        {**remarks, **proposal.remarks(), **dict.fromkeys(_SPACED, "\n")})
    world_of(parse_yaml(text, path))  # what is written can be read
    return text


def _plain(value: float) -> float | int:
    return int(value) if value == int(value) else value
