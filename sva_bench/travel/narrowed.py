"""Ways that robots in their berths make narrower."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import label

from sva_bench.geometry.clearance import CLEARANCE_MARGINS_M
from sva_bench.travel.stand_ground import PREFERRED_ROOM_M, point_of, stand_ground_of
from sva_bench.world.model import World
from sva_bench.world.places import Point

_NARROWER_M = 0.04  # from half the width of a way, what is worth a word: a step of the lattice


@dataclass(frozen=True, kw_only=True)
class Narrowed:
    """A way that robots in their berths make narrower.

    Attributes:
        one, other: The sites that it joins.
        without_m, with_m: Width of its narrowest place [m], without and with robots in all berths.
        abreast_m: Width in which two robots pass each other [m].
    """

    one: str
    other: str
    without_m: float
    with_m: float
    abreast_m: float


def narrowed_by(world: World, berths: Sequence[Point]) -> Narrowed | None:
    """The way between two sites that robots in their berths make narrowest, if they make one narrower.

    Only as far as that matters: where two robots pass each other all the same, a way counts as wide as before.

    Args:
        world: The world.
        berths: Berth of each robot, from ``place_berths``.
    """
    ground = stand_ground_of(world)
    if len(world.robots) == 1 or len(ground.sites) < 2:
        return None
    abreast_m = min(ground.apart_m / 2 + ground.radius_m + CLEARANCE_MARGINS_M[0], ground.radius_m + PREFERRED_ROOM_M)
    levels = np.arange(ground.radius_m, abreast_m, ground.field.cells.cell_m / 2)[::-1].tolist()
    widest = np.zeros((2, len(ground.sites)))  # to each site from the first, without and with robots in berths
    for row, standing in enumerate(((), berths)):
        distance_m = ground.field.distance_m.copy()
        for (x, y), robot in zip(standing, world.robots, strict=False):
            rows, columns, _ = ground.window((x, y), abreast_m + robot.model.radius_m)
            index = np.stack(np.meshgrid(np.arange(rows.start, rows.stop), np.arange(columns.start, columns.stop),
                                         indexing="ij"), axis=-1)
            away_m = np.hypot(*(ground.field.places(index.reshape(-1, 2)) - (x, y)).T).reshape(index.shape[:2])
            distance_m[rows, columns] = np.minimum(distance_m[rows, columns], away_m - robot.model.radius_m)
        for level in levels:
            parts = label(distance_m >= level)[0].astype(np.int32)
            mine = np.array([ground.part_at(parts, site) for site in ground.sites])
            widest[row] = np.where((widest[row] == 0) & (mine == mine[0]) & (mine > 0), level, widest[row])
    lost = widest[0] - widest[1]
    worst = int(np.argmax(lost))
    if lost[worst] < _NARROWER_M:
        return None
    names = {point_of(site): site.name for site in world.sites}
    one, other = (names[tuple(ground.sites[k].tolist())] for k in (0, worst))
    return Narrowed(one=one, other=other, without_m=2 * float(widest[0, worst]), with_m=2 * float(widest[1, worst]),
                    abreast_m=2 * abreast_m)
