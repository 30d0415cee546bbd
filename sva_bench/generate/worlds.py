"""New world files: terrain and sites, a mission proposed for them, and all of it checked."""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from sva_bench.choices import WorldFamily
from sva_bench.errors import BadInput
from sva_bench.files.documents import Loc, parse_yaml
from sva_bench.files.fields import NAME
from sva_bench.files.yaml_text import pretty_yaml
from sva_bench.generate.terrain import DENSITY, random_places, random_terrain
from sva_bench.geometry.cells import MAX_BOXES, TooManyBoxes, bounds_of, boxes_of
from sva_bench.geometry.distances import clearance
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.interrupts import holding_back_ctrl_c
from sva_bench.mission.failures import MODEL
from sva_bench.robot.model import BUILT_IN, USUAL_MODEL
from sva_bench.seeds import key_of
from sva_bench.workers.progress import OnProgress
from sva_bench.world.load import world_of
from sva_bench.world.maps.files import MapFile
from sva_bench.world.maps.formats import format_of
from sva_bench.world.model import MapSource
from sva_bench.world.places import NoRoom, Places, Point, enclosed_beside, field_of, find_places
from sva_bench.world.schema import KIND

_log = logging.getLogger(__name__)

STATION_STOP_S = 10
"""Time that refuelling takes, as in the shipped worlds."""

WHEEL_GAIN_SD = 0.01
"""Noise, as in the shipped worlds."""

_FIRST_WORDS: dict[WorldFamily, str] = {
    "rooms": "Rooms joined by doors", "field": "A field with scattered obstacles", "aisles": "Aisles between racks",
    "maze": "A maze"}

_SPACED: tuple[Loc, ...] = (("map",), ("sites",), ("robots",), ("scenarios",), ("failure",))


def random_world(
    family: WorldFamily, *, size_m: float, density: float | None, pois: int, stations: int, robots: int, seed: int,
    progress: OnProgress,
) -> str:
    """The text of a random world's file: the same for the same arguments.

    Args:
        family: What stands there.
        size_m: Side of the square.
        density: Density (``random_terrain``); default: the family's.
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


def world_from_map(
    source: Path, target: Path, *, base: Point | None, pois: int, stations: int, robots: int,
    settings: Mapping[str, object], spacing_m: float | None, seed: int, progress: OnProgress,
) -> tuple[str, tuple[MapFile, ...]]:
    """The text of a world file for a map, and the copies of the map's files that belong beside it.

    Args:
        source: A map's file, of one of the formats in ``world/maps/formats.py``.
        target: Where the world file will be; the world is named after it.
        base: Where the base is; ``None`` = near the middle of the largest enclosed region.
        pois, stations, robots: How many of each.
        settings: How its format is to read it, where not by default.
        spacing_m: Least distance between POIs; ``None`` = as wide as it easily goes.
        seed: Seed of POIs and mission.
        progress: Told how far it is.

    Raises:
        BadFile: If the map can't be read.
        BadInput: If sites or mission don't fit.
    """
    name = target.stem
    form = format_of(source)
    if not re.fullmatch(NAME, name):
        raise BadInput(f"{target}: the world is named after its file, and {name!r} is no valid name; use up to 64 "
                       "letters, digits, '_', '.', '-', the first a letter or digit")
    entry = form.section.model_validate({**settings, "file": source.name})
    cells, read = entry.read(source.parent, anywhere=True)
    told = {key: _plain(value) if isinstance(value, float) else value for key, value in entry.written().items()}
    section: dict[str, Any] = {form.key: {**told, "file": f"{name}-map/{read[0].name}"}}
    try:
        obstacles = Obstacles(bounds_m=bounds_of(cells), boxes=boxes_of(cells), cylinders=np.empty((0, 3)), cells=cells)
    except TooManyBoxes:
        raise BadInput(f"{source}: its occupied cells take more than the {MAX_BOXES} boxes that physics holds; clean "
                       "the map of speckles, or cut it") from None
    progress("placing the sites", 0, 1)
    places, spacing = _placed(source, obstacles, base=base, pois=pois, stations=stations, spacing_m=spacing_m,
                              seed=seed)
    progress("placing the sites", 1, 1)
    asked = "" if base is None else f" --base {base[0]:g} {base[1]:g}"
    asked += "".join(f" --{key.replace('_', '-')} {value if isinstance(value, str) else f'{value:g}'}"
                     for key, value in told.items() if key != "file")
    asked += "" if spacing_m is None else f" --min-spacing {spacing_m:g}"
    remarks: dict[Loc, str] = {
        (): f"A mission on a map: sva-bench world from-map {source.name}\n"
            f"--pois {pois} --stations {stations} --robots {robots} --seed {seed}{asked}",
        ("sites", "base"): "in the middle of the largest region that walls enclose" if base is None else "as asked for",
        ("sites", "stations"): "each as far as can be from base and stations before it, by path length",
        ("sites", "pois"): f"drawn from what is reached from the base, {spacing:g} m from each other at least"}
    data = {"map": section, "sites": sites_section(places.base, places.stations, places.pois)}
    files = tuple(replace(file, name=f"{name}-map/{file.name}") for file in read)
    ground = (obstacles, MapSource(section=section, files=files))
    text = with_mission(name, data, remarks, robots=robots, seed=seed, path=target, progress=progress, ground=ground)
    return text, files


def _placed(
    source: Path, obstacles: Obstacles, *, base: Point | None, pois: int, stations: int, spacing_m: float | None,
    seed: int,
) -> tuple[Places, float]:
    """Places of a mission's sites on a map, and their spacing [m]; warns if they may be outside the building.

    Raises:
        BadInput: If they don't fit.
    """
    radius = BUILT_IN[USUAL_MODEL].radius_m
    try:
        if base is not None and clearance(obstacles, *base) < radius:
            raise NoRoom("base", 0, 0.0)
        field = field_of(obstacles)
        places, spacing = find_places(field, base=base, radius_m=radius, stations=stations, pois=pois,
                                      spacing_m=spacing_m, seed=seed, key=obstacles.key())
    except NoRoom as error:
        where = "at the base" if error.kind == "base" and base else "on this map"
        said = f"there is no room {where}" if error.kind == "base" else str(error)
        raise BadInput(f"{source}: for a robot of radius {radius} m, {said}; choose fewer sites, another base, or "
                       "another map") from None
    if (beside := enclosed_beside(field, places.base, radius)) is not None:
        area, (x, y) = beside
        _log.warning("%s: the sites are in a region that reaches the map's rim, maybe outside of all walls; the "
                     "largest that walls enclose has %.3g m2: --base %g %g", source, area, x, y)
    return places, spacing


def sites_section(base: Point, stations: tuple[Point, ...], pois: tuple[Point, ...]) -> dict[str, Any]:
    """The section ``sites`` of a world file, with names as in the shipped worlds."""
    return {
        "base": {"at_m": list(base)},
        "stations": {f"r{k}": {"at_m": list(at), "stop_s": STATION_STOP_S} for k, at in enumerate(stations, start=1)},
        "pois": {f"p{k}": {"at_m": list(at)} for k, at in enumerate(pois, start=1)}}


def with_mission(
    name: str, data: Mapping[str, Any], remarks: Mapping[Loc, str], *, robots: int, seed: int, path: Path,
    progress: OnProgress, ground: tuple[Obstacles, MapSource] | None = None,
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
        ground: What the files hold that the map names; ``None`` if it names none.

    Raises:
        BadFile: If map and sites make no good world.
        UnreachableSite: If a site can't be reached.
        BadInput: If there are too few robots or POIs for a mission.
    """
    with holding_back_ctrl_c():  # after terrain and sites: what does not fit is said at once
        from sva_bench.generate.mission import propose_mission
        from sva_bench.study.costs import plan_costs

    head = {"format": KIND, "name": name, **data}
    robot = {"model": USUAL_MODEL, "incentives": {}}
    bare = world_of(parse_yaml(pretty_yaml({**head, "robots": {"uv1": robot}}, {}), path), ground=ground)
    (costs,) = plan_costs(bare, "prmstar", progress).values()
    progress("choosing a mission", 0, 1)
    places = key_of(*(f"{site.kind} {site.x_m!r} {site.y_m!r}" for site in bare.sites))
    proposal = propose_mission(bare.sites, costs.cost_s, robots=robots, seed=seed,
                               key=(*bare.obstacles.key(), *places))
    progress("choosing a mission", 1, 1)
    text = pretty_yaml(
        {**head, **proposal.sections(), "failure": MODEL, "margin": bare.margin,
         "noise": {"wheel_gain_sd": WHEEL_GAIN_SD}},
        {**remarks, **proposal.remarks(), **dict.fromkeys(_SPACED, "\n")})
    world_of(parse_yaml(text, path), ground=ground)  # what is written can be read
    return text


def _plain(value: float) -> float | int:
    return int(value) if value == int(value) else value
