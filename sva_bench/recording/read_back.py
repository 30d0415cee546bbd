"""Recordings read back: what a map shows, plan by plan."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.choices import SiteKind
from sva_bench.errors import BadFile
from sva_bench.palette import Color
from sva_bench.recording.rerun import held_in

_SITES: Mapping[SiteKind, str] = {"base": "base", "station": "stations", "poi": "pois"}


T = TypeVar("T")


@dataclass(frozen=True, eq=False, kw_only=True)
class Steps(Generic[T]):
    """What something is from each time [s] on, the times ascending; nothing before the first."""

    time_s: FloatArray
    values: Sequence[T]

    def at(self, time_s: float) -> T | None:
        """What it is at a time; ``None`` before the first."""
        number = int(np.searchsorted(self.time_s, time_s + 1e-9, side="right")) - 1
        return self.values[number] if number >= 0 else None


@dataclass(frozen=True, eq=False, kw_only=True)
class ShownSites:
    """The sites of one kind: names, places [m], half their size [m], and colours over time."""

    kind: SiteKind
    names: Sequence[str]
    at_m: FloatArray
    half_m: FloatArray
    colors: Steps[Sequence[Color]]


@dataclass(frozen=True, eq=False, kw_only=True)
class ShownRobot:
    """One robot.

    Attributes:
        name, color: Its name and colour.
        time_s, pose: Where it is: x, y [m], yaw [rad], shape (n, 3).
        colors: Colours of its hull over time.
        footprint: Its solids as seen from above: (x, y, half length, half width [m], yaw), and whether they are round.
        planned: Dashes of its planned path [m].
        driven: When each piece of its trail is complete [s], and its ends [m], shape (t, 2, 2).
        state: What it does.
        fuel, collected: Fuel left [s], ``None`` without a limit, and incentive collected, as corners of lines.
        lost: When it was lost [s], and what happened; ``None`` if it wasn't.
        forgone_s, forgone: When POIs were given up with it, and the crosses over them [m].
    """

    name: str
    color: Color
    time_s: FloatArray
    pose: FloatArray
    colors: Steps[Sequence[Color]]
    footprint: Sequence[tuple[tuple[float, float, float, float, float], bool]]
    planned: FloatArray
    driven: tuple[FloatArray, FloatArray]
    state: Steps[str]
    fuel: tuple[FloatArray, FloatArray] | None
    collected: Steps[float]
    lost: tuple[float, str] | None = None
    forgone_s: float = math.inf
    forgone: FloatArray = field(default_factory=lambda: np.zeros((0, 2, 2)))

    def pose_at(self, time_s: float) -> tuple[float, float, float]:
        """Where it is at a time, between two poses on the line between them."""
        x, y = (float(np.interp(time_s, self.time_s, self.pose[:, axis])) for axis in (0, 1))
        number = max(int(np.searchsorted(self.time_s, time_s + 1e-9, side="right")) - 1, 0)
        return x, y, float(self.pose[number, 2])


@dataclass(frozen=True, eq=False, kw_only=True)
class ShownPlan:
    """One plan of a recording: the map, and its robots.

    Attributes:
        name: Name of the plan, where the recording shows several; else nothing.
        bounds_m: Bounds of the floor: least x, y, greatest x, y.
        boxes: Centre x, y, half length, half width [m], yaw [rad], shape (b, 5).
        cylinders: Centre x, y, radius [m], shape (c, 3).
        sites, robots: Sites by kind, and the robots.
        total: Incentive collected by all.
    """

    name: str
    bounds_m: tuple[float, float, float, float]
    boxes: FloatArray
    cylinders: FloatArray
    sites: Sequence[ShownSites]
    robots: Sequence[ShownRobot]
    total: Steps[float]


@dataclass(frozen=True, eq=False, kw_only=True)
class Shown:
    """A recording: what it is called, how long it lasts [s], and its plans."""

    title: str
    end_s: float
    plans: Sequence[ShownPlan]


class _Entities:
    """All that a recording holds, by entity and component: constants, and what is at which times."""

    def __init__(self, path: Path) -> None:
        self.constants: dict[tuple[str, str], object] = {}
        self.steps: dict[tuple[str, str], tuple[list[int], list[object]]] = {}
        for held in held_in(path):
            key = held.entity, held.component
            if held.time_ns is None:
                self.constants[key] = held.values[-1]
            else:
                times, values = self.steps.setdefault(key, ([], []))
                times += held.time_ns
                values += held.values

    def words(self, entity: str, component: str) -> list[str]:
        """A constant as words."""
        return _words(self.constants.get((entity, component)))

    def array(self, entity: str, component: str, width: int) -> FloatArray:
        """A constant as an array, shape (n, width)."""
        return _array(self.constants.get((entity, component)), width)

    def words_at(self, entity: str, component: str) -> Steps[list[str]]:
        """Words over time."""
        return self._at_times(entity, component, _words)

    def arrays_at(self, entity: str, component: str, width: int) -> Steps[FloatArray]:
        """Arrays over time, each of shape (n, width)."""
        return self._at_times(entity, component, lambda value: _array(value, width))

    def numbers_at(self, entity: str) -> Steps[float]:
        """Numbers over time, as in charts."""
        return self._at_times(entity, "Scalars:scalars", lambda value: float(_array(value, 1)[0, 0]))

    def colors_at(self, entity: str, shape: str) -> Steps[Sequence[Color]]:
        """Colours of shapes over time."""
        return self._at_times(entity, f"{shape}:colors", _colors)

    def strips_at(self, entity: str) -> Steps[FloatArray]:
        """Lines over time, by their first two points on the floor: each of shape (n, 2, 2)."""
        return self._at_times(entity, "LineStrips3D:strips", _ends)

    def strips(self, entity: str) -> FloatArray:
        """Lines by their first two points on the floor, shape (n, 2, 2)."""
        return _ends(self.constants.get((entity, "LineStrips3D:strips")))

    def color(self, entity: str, component: str) -> Color:
        """The first of constant colours."""
        return _colors(self.constants.get((entity, component)))[0]

    def _at_times(self, entity: str, component: str, read: Callable[[object], T]) -> Steps[T]:
        """What a component is when, in order of time."""
        times, values = self.steps.get((entity, component), ([], []))
        order = sorted(range(len(times)), key=times.__getitem__)
        return Steps(time_s=np.array([times[k] for k in order]) / 1e9, values=[read(values[k]) for k in order])

    def below(self, prefix: str) -> Iterator[str]:
        """Names right below a path, in order."""
        names = {entity.removeprefix(prefix).split("/")[0] for entity, _ in (*self.constants, *self.steps)
                 if entity.startswith(prefix)}
        yield from sorted(names)


def _items(value: object) -> list[object]:
    """What a list holds; of nothing, nothing."""
    return list(value) if isinstance(value, list) else []


def _words(value: object) -> list[str]:
    return [str(word) for word in _items(value)]


def _array(value: object, width: int) -> FloatArray:
    return np.array(_items(value), dtype=np.float64).reshape(-1, width)


def _colors(value: object) -> list[Color]:
    packed = [color for color in _items(value) if isinstance(color, int)]
    return [(color >> 24 & 255, color >> 16 & 255, color >> 8 & 255) for color in packed]


def _ends(value: object) -> FloatArray:
    """The first two points of strips, on the floor."""
    strips = [_array(strip, 3)[:2, :2] for strip in map(_items, _items(value))]
    return np.array(strips, dtype=np.float64).reshape(-1, 2, 2)


def read_recording(path: Path) -> Shown:
    """Read what a recording shows on its maps.

    Raises:
        BadFile: If it is no recording of ours.
    """
    entities = _Entities(path)
    floors = sorted(entity for entity, component in entities.constants
                    if entity.endswith("world/floor") and component == "Boxes3D:centers")
    if not floors:
        raise BadFile(path, None, "", "no recording of a mission: there is no floor in it; let sva-bench write one")
    plans = [_plan(entities, floor.removesuffix("world/floor")) for floor in floors]
    # In the order in which they are compared, the stochastic one first.
    plans.sort(key=lambda plan: (plan.name != "stochastic", plan.name))
    end_s = max(times[-1] for times in (sorted(t) for t, _ in entities.steps.values()) if times) / 1e9
    title = next(iter(entities.words("__properties", "RecordingInfo:name")), path.stem)
    return Shown(title=title, end_s=end_s, plans=plans)


def _plan(entities: _Entities, below: str) -> ShownPlan:
    (x, y, _), = entities.array(f"{below}world/floor", "Boxes3D:centers", 3).tolist()
    (hx, hy, _), = entities.array(f"{below}world/floor", "Boxes3D:half_sizes", 3).tolist()
    cylinders = f"{below}world/cylinders"
    return ShownPlan(
        name=below.removesuffix("/").replace("\\", ""), bounds_m=(x - hx, y - hy, x + hx, y + hy),
        boxes=_boxes(entities, f"{below}world/boxes"),
        cylinders=np.column_stack([entities.array(cylinders, "Cylinders3D:centers", 3)[:, :2],
                                   entities.array(cylinders, "Cylinders3D:radii", 1)]),
        sites=[sites for kind, entity in _SITES.items() for sites in _sites(entities, kind, f"{below}world/{entity}")],
        robots=[_robot(entities, below, name) for name in entities.below(f"{below}world/robots/")],
        total=entities.numbers_at(f"{below}collected/total"))


def _boxes(entities: _Entities, entity: str) -> FloatArray:
    centers, halves = (entities.array(entity, f"Boxes3D:{what}", 3)[:, :2] for what in ("centers", "half_sizes"))
    turns = entities.array(entity, "Boxes3D:quaternions", 4)
    return np.column_stack([centers, halves, 2 * np.arctan2(turns[:, 2], turns[:, 3])])


def _sites(entities: _Entities, kind: SiteKind, entity: str) -> list[ShownSites]:
    shape, size = ("Cylinders3D", "radii") if kind == "poi" else ("Boxes3D", "half_sizes")
    centers = entities.array(entity, f"{shape}:centers", 3)
    if not len(centers):
        return []
    return [ShownSites(
        kind=kind, names=entities.words(f"{entity}/names", "Points3D:labels"), at_m=centers[:, :2],
        half_m=entities.array(entity, f"{shape}:{size}", 1 if kind == "poi" else 3)[:, 0],
        colors=entities.colors_at(entity, shape))]


def _robot(entities: _Entities, below: str, name: str) -> ShownRobot:
    here = f"{below}world/robots/{name}"
    places = entities.arrays_at(here, "Transform3D:translation", 3)
    turns = np.concatenate(entities.arrays_at(f"{here}/hull", "Transform3D:quaternion", 4).values)
    pose = np.column_stack([np.concatenate(places.values)[:, :2], 2 * np.arctan2(turns[:, 2], turns[:, 3])])
    bodies = [f"{here}/hull/body{of}" for of in ("", "/cylinder", "/box", "/sphere")]
    painted = [entities.colors_at(body, shape) for body in bodies
               for shape in ("Cylinders3D", "Boxes3D", "Ellipsoids3D")]
    hull = next(colors for colors in painted if len(colors.time_s))
    trail, forgone = (entities.strips_at(f"{below}world/{what}/{name}") for what in ("driven", "forgone"))
    lost = entities.words_at(f"{below}world/lost/{name}/what", "Points3D:labels")
    states = entities.words_at(f"{below}states/{name}", "StateChange:state")
    fuel = entities.numbers_at(f"{below}fuel/{name}")
    return ShownRobot(
        name=name, color=entities.color(f"{below}collected/{name}", "SeriesLines:colors"), time_s=places.time_s,
        pose=pose, colors=hull,
        footprint=[solid for body in bodies for solid in _footprint(entities, body)],
        planned=entities.strips(f"{below}world/planned/{name}"), driven=(trail.time_s, _joined(trail)),
        state=Steps(time_s=states.time_s, values=[words[0] for words in states.values]),
        fuel=(fuel.time_s, np.array(fuel.values)) if len(fuel.time_s) else None,
        collected=entities.numbers_at(f"{below}collected/{name}"),
        lost=(float(lost.time_s[0]), lost.values[0][0]) if len(lost.time_s) else None,
        forgone_s=float(forgone.time_s[0]) if len(forgone.time_s) else math.inf,
        forgone=_joined(forgone))


def _joined(strips: Steps[FloatArray]) -> FloatArray:
    """All lines of all times, shape (n, 2, 2)."""
    return np.concatenate([*strips.values, np.zeros((0, 2, 2))])


def _footprint(entities: _Entities, body: str) -> Iterator[tuple[tuple[float, float, float, float, float], bool]]:
    """Solids from above; a cylinder that lies, as wheels do, is a box."""
    boxes = _boxes(entities, body)
    yield from ((tuple(box), False) for box in boxes.tolist())
    round_ones = entities.array(body, "Cylinders3D:radii", 1)[:, 0].tolist()
    centers = entities.array(body, "Cylinders3D:centers", 3)
    turns = entities.array(body, "Cylinders3D:quaternions", 4)
    lengths = entities.array(body, "Cylinders3D:lengths", 1)[:, 0].tolist()
    for radius, length, (x, y, _), (qx, qy, _, _) in zip(round_ones, lengths, centers.tolist(), turns.tolist(),
                                                         strict=True):
        lies = qx * qx + qy * qy > 0.25
        yield (x, y, radius, length / 2 if lies else radius, 0.0), not lies
    for (x, y, _), (half, _, _) in zip(entities.array(body, "Ellipsoids3D:centers", 3).tolist(),
                                       entities.array(body, "Ellipsoids3D:half_sizes", 3).tolist(), strict=True):
        yield (x, y, half, half, 0.0), True
