"""Walls that divide a square into rooms, with doors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Line = tuple[tuple[float, float], tuple[float, float]]

_DOOR_M = (1.1, 1.5)  # widths of doors
_JAMB_M = 0.4  # from a door to the nearest corner of a room
_LOOPS = 0.35  # probability of each door beyond those of a spanning tree


@dataclass(frozen=True)
class _Room:
    x0: float
    y0: float
    x1: float
    y1: float


@dataclass(frozen=True)
class _Border:
    """The common part of two rooms' walls, at x (axis 0) or y (axis 1) = ``at``."""

    axis: int
    at: float
    low: float
    high: float


def room_walls(size_m: float, least_m: float, rng: np.random.Generator) -> list[Line]:
    """Inner walls of a square, as lines with gaps for doors that connect all rooms.

    Rooms are halved, not in the middle, until they are small. Doors are made where two rooms have enough wall in
    common, first those of a random spanning tree, then some more.

    Args:
        size_m: Side of the square.
        least_m: Shortest side of a room.
        rng: Random numbers.
    """
    for _ in range(100):
        rooms: list[_Room] = []
        walls: list[_Border] = []
        _halve(_Room(0.0, 0.0, size_m, size_m), min(least_m, size_m / 2), rooms, walls, rng)
        doors = _doors(rooms, rng)
        if doors is not None:
            return [line for wall in walls for line in _pieces(wall, doors)]
    raise RuntimeError("a hundred ways to divide a square, and none has room for the doors")


def _halve(room: _Room, least: float, rooms: list[_Room], walls: list[_Border], rng: np.random.Generator) -> None:
    width, height = room.x1 - room.x0, room.y1 - room.y0
    longest = max(width, height)
    small = longest < 3 * least and rng.random() < 0.4
    if longest < 2 * least or (small and rooms):
        rooms.append(room)
        return
    axis = 0 if width > height or (width == height and rng.random() < 0.5) else 1
    start = room.x0 if axis == 0 else room.y0
    at = round(start + float(rng.uniform(max(least, 0.3 * longest), longest - max(least, 0.3 * longest))), 1)
    if axis == 0:
        walls.append(_Border(0, at, room.y0, room.y1))
        parts = (_Room(room.x0, room.y0, at, room.y1), _Room(at, room.y0, room.x1, room.y1))
    else:
        walls.append(_Border(1, at, room.x0, room.x1))
        parts = (_Room(room.x0, room.y0, room.x1, at), _Room(room.x0, at, room.x1, room.y1))
    for component in parts:
        _halve(component, least, rooms, walls, rng)


def _doors(rooms: list[_Room], rng: np.random.Generator) -> list[_Border] | None:
    """Doors that connect all rooms; ``None`` if some have too little wall in common."""
    borders = [(a, b, border) for a in range(len(rooms)) for b in range(a)
               if (border := _border(rooms[a], rooms[b])) is not None]
    component = list(range(len(rooms)))
    doors = []
    for k in rng.permutation(len(borders)):
        a, b, border = borders[int(k)]
        loop = component[a] == component[b]
        if not loop:
            component = [component[a] if p == component[b] else p for p in component]
        elif rng.random() >= _LOOPS:
            continue
        width = round(float(rng.uniform(*_DOOR_M)), 1)
        start = round(float(rng.uniform(border.low + _JAMB_M, border.high - _JAMB_M - width)), 1)
        doors.append(_Border(border.axis, border.at, start, round(start + width, 1)))
    return doors if len(set(component)) == 1 else None


def _border(one: _Room, other: _Room) -> _Border | None:
    """Where a door between two rooms can be."""
    for axis, at, low, high in (
        (0, one.x0, max(one.y0, other.y0), min(one.y1, other.y1)) if one.x0 == other.x1 else
        (0, one.x1, max(one.y0, other.y0), min(one.y1, other.y1)) if one.x1 == other.x0 else (0, 0.0, 0.0, 0.0),
        (1, one.y0, max(one.x0, other.x0), min(one.x1, other.x1)) if one.y0 == other.y1 else
        (1, one.y1, max(one.x0, other.x0), min(one.x1, other.x1)) if one.y1 == other.y0 else (1, 0.0, 0.0, 0.0),
    ):
        if high - low >= _DOOR_M[1] + 2 * _JAMB_M + 0.1:
            return _Border(axis, at, low, high)
    return None


def _pieces(wall: _Border, doors: list[_Border]) -> list[Line]:
    """The parts of a wall between its doors."""
    inside = sorted((door.low, door.high) for door in doors
                    if (door.axis, door.at) == (wall.axis, wall.at) and wall.low <= door.low and door.high <= wall.high)
    ends = [wall.low, *(end for door in inside for end in door), wall.high]
    return [((wall.at, low), (wall.at, high)) if wall.axis == 0 else ((low, wall.at), (high, wall.at))
            for low, high in zip(ends[::2], ends[1::2], strict=True)]
