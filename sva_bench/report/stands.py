"""Where robots of one world stand: their berths at the base, and the slots of stations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.choices import StandKind
from sva_bench.travel.berths import own_world, place_berths
from sva_bench.world.model import Site, World


@dataclass(frozen=True, kw_only=True)
class Stand:
    """A place for one robot.

    Attributes:
        kind: Berth or slot.
        name: The robot whose berth it is, or the station that the slot belongs to.
        x_m, y_m: Its centre [m].
        radius_m: Radius of the widest robot that stands there [m].
    """

    kind: StandKind
    name: str
    x_m: float
    y_m: float
    radius_m: float

    def outline(self, points: int) -> FloatArray:
        """Points about it and between [m], shape (2 * points, 2)."""
        angle = np.linspace(0, 2 * np.pi, points, endpoint=False)
        ring = self.radius_m * np.column_stack([np.cos(angle), np.sin(angle)])
        outline: FloatArray = np.array([self.x_m, self.y_m]) + np.concatenate([ring, ring / 2])
        return outline


def stands_of(world: World) -> tuple[Stand, ...]:
    """The berths of all robots, and the slots that they use of stations with several; none where robots do not meet.

    Raises:
        NoRoomForBerths, NoRoomForSlots: If robots don't fit about the base, or about a station.
    """
    if not world.meets:
        return ()
    berths = place_berths(world)
    stands = [Stand(kind="berth", name=robot.name, x_m=x, y_m=y, radius_m=robot.model.radius_m)
              for robot, (x, y) in zip(world.robots, berths, strict=True)]
    slots: dict[tuple[str, float, float], float] = {}
    for number, robot in enumerate(world.robots):
        for site in own_world(world, berths, number).sites:
            if site.slots > 1:
                key = site.name, site.x_m, site.y_m
                slots[key] = max(slots.get(key, 0.0), robot.model.radius_m)
    return (*stands, *(Stand(kind="slot", name=name, x_m=x, y_m=y, radius_m=radius)
                       for (name, x, y), radius in slots.items()))


def _served(stations: Sequence[Site]) -> str:
    """How many robots each station serves at a time."""
    several = ", ".join(f"{site.name} {site.slots}" for site in stations if site.slots > 1)
    alone = [site.name for site in stations if site.slots == 1]
    if not several:
        return "each station serves one robot at a time"
    one = f"; {'the other serves' if len(alone) == 1 else 'the others serve'} one" if alone else ""
    return f"robots that stations serve at a time, by their slots: {several}{one}"


def interaction_lines(world: World, stands: tuple[Stand, ...]) -> list[str]:
    """What a check says of how robots meet; nothing where it is as usual."""
    several = [site for site in world.stations if site.slots > 1]
    if not world.meets:
        alone = [] if world.interaction == "independent" else [
            f"interaction {world.interaction}: there is one robot, which meets nobody"]
        return [*alone, *([f"slots of {', '.join(site.name for site in several)} have no effect: robots do not meet"]
                          if several else [])]
    berths = [stand for stand in stands if stand.kind == "berth"]
    told = ", ".join(f"{stand.name} at ({stand.x_m:.2f}, {stand.y_m:.2f})" for stand in berths)
    lines = [f"interaction {world.interaction}: {len(berths)} berths at the base, {told}"]
    if world.stations and world.interaction == "shared":
        lines.append(_served(world.stations))
    return lines
