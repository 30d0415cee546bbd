"""What is likely not meant as it stands in a world: passages that lie elsewhere, loads that no motor moves."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import permutations

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.execution.waits import crossings_of
from sva_bench.robot.model import MOTOR_RESERVE
from sva_bench.travel.berths import place_berths
from sva_bench.travel.fuel import FuelCosts
from sva_bench.travel.narrowed import narrowed_by
from sva_bench.world.model import World


def doubtful_passages(world: World, costs: Mapping[str, FuelCosts]) -> list[str]:
    """A sentence for each passage that no robot fits through, or that no path between sites crosses.

    Args:
        world: The world.
        costs: Its fuel costs by robot model.
    """
    if not world.passages:
        return []
    narrowest_m = 2 * min(robot.model.radius_m for robot in world.robots)
    paths = _planned_paths(costs)
    rims = np.array([[*path.min(axis=0), *path.max(axis=0)] for path in paths]).reshape(-1, 4)
    said = []
    for passage in world.passages:
        ends = np.reshape(passage.ends_m, (2, 2))
        width_m = float(np.linalg.norm(ends[1] - ends[0]))
        if width_m < narrowest_m:
            said.append(f"passage {passage.name} is {width_m:.3g} m wide, and the narrowest robot {narrowest_m:.3g} m: "
                        "let its at_m reach across the whole door")
            continue
        near = (rims[:, :2] <= ends.max(axis=0)).all(axis=1) & (rims[:, 2:] >= ends.min(axis=0)).all(axis=1)
        if not any(crossings_of(paths[k], passage) for k in np.flatnonzero(near).tolist()):
            said.append(f"no planned path crosses passage {passage.name}, so no robot ever waits there: let its at_m "
                        "reach across a door that robots drive through, or remove it")
    return said


def doubtful_berths(world: World) -> list[str]:
    """A sentence about the way that robots in their berths narrow most, so that two don't pass each other."""
    way = narrowed_by(world, place_berths(world)) if world.meets else None
    return [] if way is None else [
        f"robots in their berths narrow the way from {way.one} to {way.other}, from "
        f"{'more than' if way.without_m > way.abreast_m - 0.1 else 'about'} {way.without_m:.2f} m to about "
        f"{way.with_m:.2f} m, where two robots need {way.abreast_m:.2f} m to pass each other: move the base to a more "
        "open place, or widen the passages about it"]


def doubtful_loads(world: World) -> list[str]:
    """A sentence for each robot model whose motors can't accelerate the greatest payload as its limits ask."""
    load_kg = world.noise.payload_kg[1]
    masses = {robot.model.name: robot.model.mass_kg for robot in world.robots}
    return [f"noise.payload_kg: up to {load_kg:g} kg on {name}, which weighs {mass_kg:g} kg itself: its motors bear "
            f"{(MOTOR_RESERVE - 1) * mass_kg:.3g} kg more at the accelerations of its model, and a robot that is "
            "slower than planned runs dry, comes late or gets stuck; lower the payload, or give a stronger robot"
            for name, mass_kg in masses.items() if load_kg > (MOTOR_RESERVE - 1) * mass_kg]


def _planned_paths(costs: Mapping[str, FuelCosts]) -> list[FloatArray]:
    """The paths that routes are put together from; those dearer than a chain of others are never driven."""
    return [cost.times.path(a, b) for cost in costs.values() for a, b in permutations(cost.times.sites, 2)
            if cost.chain(a, b) == (a, b)]
