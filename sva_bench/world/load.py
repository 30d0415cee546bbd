"""Loading of world files into resolved worlds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from sva_bench.choices import USUAL_NEWS, FailureProcess, SiteKind
from sva_bench.errors import BadFile, nearest
from sva_bench.files.documents import Document, read_yaml, validate
from sva_bench.geometry.buckets import longest_view_heading, sight_checker
from sva_bench.geometry.cells import MAX_BOXES, TooManyBoxes, bounds_of, boxes_of
from sva_bench.geometry.distances import clearance
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.mission.failures import JointState, availability_by, marginals, undefined_under, without_joint
from sva_bench.seeds import Stream, rng_for
from sva_bench.world.model import MapSource, Robot, Scenario, Site, World, WorldReaction, nominal_of
from sva_bench.world.noise_schema import noise_as_dict
from sva_bench.world.places import APART_M, NoRoom, field_of, find_places
from sva_bench.world.robots import model_entry, model_of
from sva_bench.world.schema import (
    KIND,
    Box,
    Cylinder,
    Drawn,
    Joint,
    Map,
    RandomPois,
    ReactionEntry,
    RobotEntry,
    Shapes,
    SiteEntry,
    Sites,
    SpreadStations,
    StationEntry,
    WorldFile,
)
from sva_bench.world.within import refuse_outside

AMBIGUOUS = "robots that meet wait for each other by name, and this one is that of {}; rename the robot"
_Entry = tuple[SiteKind, str, SiteEntry, tuple[str, ...]]  # a site, and its location in the file


def load_world(path: Path) -> World:
    """Read and resolve a world file.

    Raises:
        BadFile: With file, line, key and what to change.
    """
    return world_of(read_yaml(path))


def world_of(
    document: Document, folder: Path | None = None, ground: tuple[Obstacles, MapSource] | None = None
) -> World:
    """The resolved world of a world file's content.

    Args:
        document: The content.
        folder: Folder of the files that it names; by default its own.
        ground: Obstacles and source of its map, if read already.

    Raises:
        BadFile: As ``load_world``.
    """
    file = validate(document, WorldFile, KIND)
    root = folder or document.path.parent
    obstacles, source = ground or _map(document, file.map, root)
    refuse_outside(document, file, obstacles.bounds_m)
    pois = [f"p{k + 1}" for k in range(file.sites.pois.random)] if isinstance(file.sites.pois, RandomPois) else list(
        file.sites.pois)
    robots = tuple(_robot(document, name, entry, pois, root) for name, entry in file.robots.items())
    widest = max(robot.model.radius_m for robot in robots)
    sites = _sites(document, file, obstacles, widest)
    plan, execute = (
        (file.failure, file.failure) if isinstance(file.failure, str) else (file.failure.plan, file.failure.execute))
    scenarios = _scenarios(document, file, robots)
    if (other := without_joint([plan, execute])) and (correlated := [s.name for s in scenarios if s.joint is not None]):
        raise document.error(("scenarios", correlated[0], "joint"), f"under {other} robots fail independently; give "
                             "their availabilities, or choose another failure process")
    _refuse_unknown_failures(document, file, robots, scenarios, (plan, execute))
    world = World(
        name=file.name, obstacles=obstacles, sites=sites, robots=robots, scenarios=scenarios,
        plan_failure=plan, execute_failure=execute, margin=file.margin,
        noise=file.noise.noise(), map_source=source,
        reaction=_reaction(document, file.reaction, stations=any(site.kind == "station" for site in sites)),
        passages=tuple(entry.passage(name) for name, entry in file.passages.items()), interaction=file.interaction,
        departures=file.departures,
    )
    if (clash := world.ambiguous_robot) is not None:
        raise document.error(("robots", clash[0]), AMBIGUOUS.format(clash[1]))
    return world


def _map(document: Document, section: Map, root: Path) -> tuple[Obstacles, MapSource | None]:
    if section.shapes is not None:
        return obstacles_of(section.shapes), None
    found = section.source()
    assert found is not None, "the schema requires one of them"
    kind, source = found
    try:
        cells, files = source.read(root)
    except BadFile as error:
        if error.path == source.file:  # about the name given in the world file, not about the map's content
            raise document.error(("map", kind, "file"), f"{error.path}: {error.problem}") from None
        raise
    try:
        boxes = boxes_of(cells)
    except TooManyBoxes:
        raise document.error(("map", kind, "file"), f"its occupied cells take more than the {MAX_BOXES} boxes that "
                             "physics holds; clean the map of speckles, or cut it") from None
    obstacles = Obstacles(bounds_m=bounds_of(cells), boxes=boxes, cylinders=np.empty((0, 3)), cells=cells)
    return obstacles, MapSource(section={kind: source.model_dump()}, files=files)


def obstacles_of(shapes: Shapes) -> Obstacles:
    """The obstacles that a description by shapes defines."""
    boxes, cylinders = [], []
    for shape in shapes.obstacles:
        if isinstance(shape, Cylinder):
            cylinders.append([*shape.cylinder, shape.radius_m])
        elif isinstance(shape, Box):
            boxes.append([*shape.box, shape.size_m[0] / 2, shape.size_m[1] / 2, _radians(shape.yaw_deg)])
        else:
            (ax, ay), (bx, by) = shape.wall
            boxes.append([(ax + bx) / 2, (ay + by) / 2, math.hypot(bx - ax, by - ay) / 2, shape.thickness_m / 2,
                          _radians(math.degrees(math.atan2(by - ay, bx - ax)))])
    return Obstacles(bounds_m=np.array(shapes.bounds_m), boxes=np.array(boxes).reshape(-1, 5),
                     cylinders=np.array(cylinders).reshape(-1, 3), floors=np.array([
                         [*f.box, f.size_m[0] / 2, f.size_m[1] / 2, _radians(f.yaw_deg), f.friction]
                         for f in shapes.floors]).reshape(-1, 6))


def _sites(document: Document, file: WorldFile, obstacles: Obstacles, widest_m: float) -> tuple[Site, ...]:
    base: _Entry = ("base", "base", file.sites.base, ("sites", "base"))
    entries = [base]
    if clearance(obstacles, *file.sites.base.at_m) >= widest_m:  # else the error is the base's place
        entries += _stations_and_pois(document, file.sites, obstacles, widest_m)
    sites: list[Site] = []
    sight = sight_checker(obstacles)
    for kind, name, entry, loc in entries:
        if any(site.name == name for site in sites):
            raise document.error(loc, f"there is another site named {name!r}; names must differ")
        x, y = entry.at_m
        gap = clearance(obstacles, x, y)
        if gap < widest_m:
            raise document.error((*loc, "at_m"), f"{name!r} is {_misplaced(obstacles, x, y, gap)}; a robot of radius "
                                 f"{widest_m} m doesn't fit there: move the site")
        heading = (_radians(math.degrees(longest_view_heading(obstacles, x, y, sight))) if entry.heading_deg is None
                   else _radians(entry.heading_deg))
        sites.append(Site(name=name, kind=kind, x_m=x, y_m=y, heading_rad=heading, stop_s=entry.stop_s,
                          charge_rate=entry.charge_rate if isinstance(entry, StationEntry) else None,
                          slots=entry.slots if isinstance(entry, StationEntry) else 1))
    for k, site in enumerate(sites):
        for other in sites[:k]:
            if math.hypot(site.x_m - other.x_m, site.y_m - other.y_m) < 0.01:
                raise document.error(entries[k][3], f"{site.name!r} and {other.name!r} are in one place; move one of "
                                     "them")
    return tuple(sites)


def _misplaced(obstacles: Obstacles, x: float, y: float, gap: float) -> str:
    """What is wrong with a place that has too little room, a gap of so much [m]."""
    x_min, y_min, x_max, y_max = obstacles.bounds_m
    outer = min(x - x_min, y - y_min, x_max - x, y_max - y)
    if outer < 0:
        return f"outside the bounds, {x_min:g} to {x_max:g} m and {y_min:g} to {y_max:g} m"
    if gap < outer:
        return "inside an obstacle" if gap <= 0 else f"only {gap:.3f} m from an obstacle"
    return "on the bounds, where the outer walls stand" if gap <= 0 else f"only {gap:.3f} m from an outer wall"


def _stations_and_pois(document: Document, sites: Sites, obstacles: Obstacles, widest_m: float) -> list[_Entry]:
    """The stations and POIs that the file lists, and those that it has placed automatically."""
    spread = sites.stations if isinstance(sites.stations, SpreadStations) else None
    drawn = sites.pois if isinstance(sites.pois, RandomPois) else None
    stations: list[_Entry] = [] if isinstance(sites.stations, SpreadStations) else [
        ("station", name, entry, ("sites", "stations", name)) for name, entry in sites.stations.items()]
    pois: list[_Entry] = [] if isinstance(sites.pois, RandomPois) else [
        ("poi", name, entry, ("sites", "pois", name)) for name, entry in sites.pois.items()]
    if spread is None and drawn is None:
        return stations + pois
    x, y = sites.base.at_m
    try:
        places, _ = find_places(
            field_of(obstacles), base=(x, y), radius_m=widest_m, stations=0 if spread is None else spread.spread,
            pois=0 if drawn is None else drawn.random, seed=0 if drawn is None else drawn.seed,
            spacing_m=APART_M if drawn is None else drawn.min_spacing_m,
            others=[(entry.at_m[0], entry.at_m[1]) for _, _, entry, _ in stations + pois])
    except NoRoom as error:
        if error.kind == "base":
            raise document.error(("sites", "base", "at_m"), "there is too little room about the base to place sites "
                                 "that are reached from it: move it to where there is more") from None
        otherwise = "a smaller min_spacing_m" if error.kind == "pois" else "a base with more free ground about it"
        raise document.error(("sites", error.kind), f"{error}; choose fewer, or {otherwise}") from None
    if spread is not None:
        stations = [("station", f"r{k}", StationEntry(at_m=list(at), stop_s=spread.stop_s, slots=spread.slots,
                                                      charge_rate=spread.charge_rate), ("sites", "stations"))
                    for k, at in enumerate(places.stations, start=1)]
    if drawn is not None:
        pois = [("poi", f"p{k}", SiteEntry(at_m=list(at), stop_s=drawn.stop_s), ("sites", "pois"))
                for k, at in enumerate(places.pois, start=1)]
    return stations + pois


def _robot(document: Document, name: str, entry: RobotEntry, pois: list[str], root: Path) -> Robot:
    loc = ("robots", name)
    model, urdf = model_of(document, name, entry.model, root)
    if isinstance(entry.incentives, Drawn):
        incentives = draw_incentives(entry.incentives, pois)
    else:
        incentives = dict(entry.incentives)
        for poi in incentives:
            if poi not in pois:
                raise document.error((*loc, "incentives", poi), f"there is no POI {poi!r}; {nearest(poi, pois)}")
    limit_s = math.inf if entry.mission_limit_s is None else entry.mission_limit_s
    return Robot(
        name=name, model=model, urdf=urdf, incentives=incentives, mtbf_s=entry.mtbf_s, loss_cost=entry.loss_cost,
        idle_share=entry.idle_share,
        fuel_capacity_s=math.inf if entry.fuel_capacity_s is None else entry.fuel_capacity_s, mission_limit_s=limit_s,
        availability=availability_by(entry.mtbf_s, limit_s) if entry.availability is None else entry.availability,
    )


def draw_incentives(drawn: Drawn, pois: list[str]) -> dict[str, float]:
    """Uniform random incentives of all POIs, rounded to 0.01, with a share of them zero.

    Source:
        Section 5.1 of the paper: U(0, 150) with half of the POIs at zero, and U(0, 170).
    """
    rng = rng_for(drawn.seed, Stream.INCENTIVE)
    low, high = drawn.uniform
    values = np.round(rng.uniform(low, high, size=len(pois)), 2)
    values[rng.permutation(len(pois))[: round(drawn.zero_share * len(pois))]] = 0.0
    return {poi: float(value) for poi, value in zip(pois, values, strict=True)}


def _scenarios(document: Document, file: WorldFile, own: Sequence[Robot]) -> tuple[Scenario, ...]:
    robots = {robot.name: robot.availability for robot in own}
    if file.scenarios is None:
        return (nominal_of(own),)
    scenarios = []
    for name, entry in file.scenarios.items():
        loc: tuple[str | int, ...] = ("scenarios", name)
        if isinstance(entry, Joint):
            for k, state in enumerate(entry.joint):
                for i, robot in enumerate(state.available):
                    _known(document, (*loc, "joint", k, "available", i), robot, robots)
            joint = tuple(
                JointState(probability=s.probability, available=frozenset(s.available)) for s in entry.joint)
            total = sum(state.probability for state in joint)
            if abs(total - 1) > 1e-9:
                raise document.error((*loc, "joint"), f"the probabilities add up to {total:.12g}, not to 1")
            scenarios.append(Scenario(name=name, availability=marginals(joint, list(robots)), joint=joint))
        else:
            for robot in entry:
                _known(document, (*loc, robot), robot, robots)
            scenarios.append(Scenario(name=name, availability=robots | entry, mtbf_s={
                robot: mtbf for robot, mtbf in nominal_of(own).mtbf_s.items() if robot not in entry}))
    return tuple(scenarios)


def _refuse_unknown_failures(document: Document, file: WorldFile, robots: Sequence[Robot],
                             scenarios: Sequence[Scenario], processes: Sequence[FailureProcess]) -> None:
    """Refuse robots of which a process doesn't know how they fail, at the key that says their availability."""
    for scenario in (nominal_of(robots), *scenarios):
        for robot in robots:
            if problem := undefined_under(processes, scenario.reliability(robot)):
                named = (file.scenarios or {}).get(scenario.name)
                loc: tuple[str | int, ...] = ("robots", robot.name, "availability")
                if isinstance(named, dict) and robot.name in named:
                    loc = ("scenarios", scenario.name, robot.name)
                raise document.error(loc, f"{problem} of the robot")


def _reaction(document: Document, entry: ReactionEntry, *, stations: bool) -> WorldReaction:
    if entry.policy == "none":
        if entry.news not in (None, "never"):
            raise document.error(("reaction", "news"), "the policy is 'none', as it is by default, and has no use for "
                                 "news; leave it out, or choose 'policy: resolve'")
        return WorldReaction()
    if entry.news == "station" and not stations:
        raise document.error(("reaction", "news"), "there is no station to hear it at; place one under sites.stations, "
                             "or choose 'report' or 'instant'")
    return WorldReaction(policy=entry.policy, news=entry.news or USUAL_NEWS)


def _known(document: Document, loc: tuple[str | int, ...], robot: str, robots: Mapping[str, float]) -> None:
    if robot not in robots:
        raise document.error(loc, f"there is no robot {robot!r}; {nearest(robot, list(robots))}")


def _radians(angle_deg: float) -> float:
    """An angle of a file [rad], rounded to the nanodegree, so that ``_degrees`` inverts it exactly."""
    return math.radians(round(angle_deg, 9))


def _degrees(angle_rad: float) -> float:
    return round(math.degrees(angle_rad), 9)


def world_as_dict(world: World) -> dict[str, Any]:
    """The resolved world as the content of a world file, from which the same world is loaded."""
    def entry(site: Site) -> dict[str, Any]:
        return {"at_m": [site.x_m, site.y_m], "heading_deg": _degrees(site.heading_rad),
                "stop_s": site.stop_s, **({} if site.charge_rate is None else {"charge_rate": site.charge_rate}),
                **({} if site.slots == 1 else {"slots": site.slots})}

    def limit(seconds: float) -> float | None:
        return seconds if math.isfinite(seconds) else None

    def map_section() -> dict[str, Any]:
        if world.map_source is not None:
            return {kind: dict(entry) for kind, entry in world.map_source.section.items()}
        floors = [{"box": [f[0], f[1]], "size_m": [2 * f[2], 2 * f[3]], "yaw_deg": _degrees(f[4]), "friction": f[5]}
                  for f in o.floors.tolist()]
        return {"shapes": {"bounds_m": o.bounds_m.tolist(), "obstacles": shapes,
                           **({"floors": floors} if floors else {})}}

    o = world.obstacles
    shapes: list[dict[str, Any]] = [
        {"box": [b[0], b[1]], "size_m": [2 * b[2], 2 * b[3]], "yaw_deg": _degrees(b[4])} for b in o.boxes.tolist()]
    shapes += [{"cylinder": [c[0], c[1]], "radius_m": c[2]} for c in o.cylinders.tolist()]
    reacts = world.reaction.policy != "none"
    return {
        "format": KIND, "name": world.name,
        "map": map_section(),
        "sites": {"base": entry(world.sites[0]), "stations": {s.name: entry(s) for s in world.stations},
                  "pois": {s.name: entry(s) for s in world.pois}},
        "robots": {r.name: {
            "model": model_entry(r),
            "fuel_capacity_s": limit(r.fuel_capacity_s), "mission_limit_s": limit(r.mission_limit_s),
            "availability": r.availability, **({} if r.mtbf_s is None else {"mtbf_s": r.mtbf_s}),
            **({"loss_cost": r.loss_cost} if r.loss_cost else {}),
            **({"idle_share": r.idle_share} if r.idle_share else {}), "incentives": dict(r.incentives)}
            for r in world.robots},
        # An availability replaces a robot's mtbf_s, so those it holds for have none here.
        "scenarios": {s.name: {r: p for r, p in s.availability.items() if r not in s.mtbf_s} if s.joint is None else {
            "joint": [
            {"probability": j.probability, "available": sorted(j.available)} for j in s.joint]}
            for s in world.scenarios},
        "failure": {"plan": world.plan_failure, "execute": world.execute_failure},
        # What is as usual is absent: names of runs depend on it.
        **({"reaction": asdict(world.reaction)} if reacts else {}),
        **({} if world.interaction == "independent" else {"interaction": world.interaction}),
        **({} if world.departures == "together" else {"departures": world.departures}),
        "margin": world.margin, "noise": noise_as_dict(world.noise),
        **({"passages": {p.name: {"at_m": [list(p.ends_m[:2]), list(p.ends_m[2:])], "blocked": p.blocked,
                                  "wait_s": p.wait_s} for p in world.passages}} if world.passages else {}),
    }
