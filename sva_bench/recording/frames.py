"""Frames of a video: each plan's map from above, with its robots, what they do, and a clock. The same each time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sva_bench.arrays import FloatArray
from sva_bench.choices import FilmMark
from sva_bench.palette import ALARM, BLACK, GREEN, YELLOW, Color
from sva_bench.recording.colors import pale
from sva_bench.recording.pictures import Canvas, Pixel, width_of
from sva_bench.recording.read_back import Shown, ShownPlan, ShownRobot

_MAP_PX, _PAIR_PX = 900, 640  # greatest side of a map alone, and of one of two
_HEAD_PX, _ROW_PX, _LINE_PX, _GAP_PX = 44, 24, 20, 16  # heights of title, rows and lines of the legend, and margin
_SUM_PX = 416  # right edge of what a robot collected, from the left edge of its map
_TOGETHER_PX = 12  # robots so near to each other share a line for their names
_PAPER: Color = (255, 255, 255)
_INK: Color = (30, 30, 30)
_FLOOR: Color = (240, 240, 240)
_WALLS: Color = (140, 140, 140)
_LEAST_PX = 7  # radius of a robot, however large the world
_LEGEND: Sequence[tuple[FilmMark, Color | None, str]] = (
    ("disc", YELLOW, "POI, the larger the more it is worth"),
    ("disc", None, "POI that a robot of this colour collected"), ("cross", None, "POI that it left"),
    ("cross", ALARM, "lost robot"), ("dash", None, "planned"), ("line", None, "driven"), ("square", GREEN, "station"),
    ("diamond", BLACK, "base"))
"""Marks, their colours (``None``: that of a robot), and what they mean."""


@dataclass(frozen=True, kw_only=True)
class _Place:
    """Where a map is in a frame: its corner [px], how many px a metre is, and the floor's corner [m]."""

    left: float
    top: float
    scale: float
    x0_m: float
    y1_m: float

    def at(self, x: float, y: float) -> Pixel:
        """The pixel of a point."""
        return self.left + (x - self.x0_m) * self.scale, self.top + (self.y1_m - y) * self.scale


class Frames:
    """Draws a recording at any moment."""

    def __init__(self, shown: Shown) -> None:
        self._shown = shown
        most = _MAP_PX if len(shown.plans) == 1 else _PAIR_PX
        x0, y0, x1, y1 = _extent(shown.plans[0])
        scale = most / max(x1 - x0, y1 - y0)
        wide, tall = (x1 - x0) * scale, (y1 - y0) * scale
        column = max(wide, 420.0)  # room for the words below
        robots = max(len(plan.robots) for plan in shown.plans)
        self._rows_at = _HEAD_PX + tall + 10 + (_ROW_PX if len(shown.plans) > 1 else 0)
        self.width = _even(len(shown.plans) * (column + _GAP_PX) + _GAP_PX)
        legend = self._legend()
        self._legend_at = self._rows_at + (robots + (robots > 1)) * _ROW_PX + 8
        self.height = _even(self._legend_at + len(legend) * _LINE_PX + 8)
        self._columns = [_GAP_PX + number * (column + _GAP_PX) for number in range(len(shown.plans))]
        top = _HEAD_PX + (_ROW_PX if len(shown.plans) > 1 else 0)
        self._places = [_Place(left=left + (column - wide) / 2, top=top, scale=scale, x0_m=x0, y1_m=y1)
                        for left in self._columns]
        self._still = Canvas(self.width, self.height, _PAPER)
        self._trailed_s = -1.0
        self._still.text((_GAP_PX, 12), shown.title, 18, _INK)
        self._draw_legend(legend)
        for plan, place, left in zip(shown.plans, self._places, self._columns, strict=True):
            if plan.name:
                self._still.text((left, _HEAD_PX), f"{plan.name} plan", 14, _INK)
            _ground(self._still, plan, place)

    def at(self, time_s: float) -> NDArray[np.uint8]:
        """The frame of a moment, shape (height, width, 3); moments must ascend, for trails only grow.

        Raises:
            ValueError: If they don't.
        """
        if time_s < self._trailed_s:
            raise ValueError(f"moments must ascend: {time_s} s after {self._trailed_s} s")
        for plan, place in zip(self._shown.plans, self._places, strict=True):
            for robot in plan.robots:
                times, pieces = robot.driven
                for piece in pieces[(times > self._trailed_s) & (times <= time_s)].tolist():
                    _line(self._still, place, piece, robot.color, 2.2)
        self._trailed_s = time_s
        frame = self._still.copy()
        minutes, seconds = divmod(int(time_s), 60)
        frame.text((self.width - _GAP_PX, 12), f"{minutes}:{seconds:02d}", 18, _INK, align="right")
        for plan, place, left in zip(self._shown.plans, self._places, self._columns, strict=True):
            _sites(frame, plan, place, time_s)
            for robot in plan.robots:
                if time_s >= robot.forgone_s:
                    for stroke in robot.forgone.tolist():
                        _line(frame, place, stroke, robot.color, 2.5)
            # Lost ones are seen above those that stand in the same place.
            for robot in sorted(plan.robots, key=lambda robot: robot.lost is not None and time_s >= robot.lost[0]):
                _robot(frame, robot, place, time_s)
            gone = {robot.name for robot in plan.robots if robot.lost is not None and time_s >= robot.lost[0]}
            for (px, py), names in _named(plan, place, time_s):
                up = 26 if gone.isdisjoint(names) else 46  # above the cross
                frame.text((px, py - up), ", ".join(names), 12, _INK, align="middle", halo=True)
            self._rows(frame, plan, left, time_s)
        return frame.pixels()

    def _rows(self, canvas: Canvas, plan: ShownPlan, left: float, time_s: float) -> None:
        """A row for each robot: its colour, what it does, what fuel it has left, and what it collected."""
        for number, robot in enumerate(plan.robots):
            y = self._rows_at + number * _ROW_PX
            state = robot.state.at(time_s) or ""
            gone = robot.lost is not None and time_s >= robot.lost[0]
            canvas.disc((left + 8, y + 9), 6, robot.color)
            canvas.text((left + 22, y), robot.name, 14, _INK)
            canvas.text((left + 110, y), state, 14, ALARM if gone else _INK)
            if robot.fuel is not None and not gone:
                canvas.text((left + 300, y), f"fuel {np.interp(time_s, *robot.fuel):.0f} s", 14, _INK, align="right")
            canvas.text((left + _SUM_PX, y), f"collected {robot.collected.at(time_s) or 0.0:.6g}", 14, _INK,
                        align="right")
        if len(plan.robots) > 1:
            y = self._rows_at + len(plan.robots) * _ROW_PX
            canvas.text((left + 22, y), "all robots", 14, _INK)
            canvas.text((left + _SUM_PX, y), f"collected {plan.total.at(time_s) or 0.0:.6g}", 14, _INK, align="right")

    def _legend(self) -> list[list[tuple[float, FilmMark, Color, str]]]:
        """What marks mean, in lines: where each begins [px], the mark, its colour, and words."""
        lines: list[list[tuple[float, FilmMark, Color, str]]] = [[]]
        mine = self._shown.plans[0].robots[0].color
        x = float(_GAP_PX)
        for mark, color, words in _LEGEND:
            wide = 16 + width_of(words, 12)
            if lines[-1] and x + wide > self.width - _GAP_PX:
                lines.append([])
                x = float(_GAP_PX)
            lines[-1].append((x, mark, color or (pale(mine) if mark == "dash" else mine), words))
            x += wide + 18
        return lines

    def _draw_legend(self, lines: list[list[tuple[float, FilmMark, Color, str]]]) -> None:
        for number, line in enumerate(lines):
            y = self._legend_at + number * _LINE_PX
            for x, mark, color, words in line:
                _mark(self._still, (x + 6, y + 7), mark, color)
                self._still.text((x + 16, y), words, 12, _INK)


def _ground(canvas: Canvas, plan: ShownPlan, place: _Place) -> None:
    x0, y0, x1, y1 = plan.bounds_m
    canvas.rectangle([place.at(x0, y1), place.at(x1, y0)], _FLOOR, _WALLS)
    for box in plan.boxes.tolist():
        canvas.polygon(_box(place, box), _WALLS)
    for x, y, radius in plan.cylinders.tolist():
        canvas.disc(place.at(x, y), radius * place.scale, _WALLS)
    for robot in plan.robots:
        for dash in robot.planned.tolist():
            _line(canvas, place, dash, pale(robot.color), 1.4)


def _sites(canvas: Canvas, plan: ShownPlan, place: _Place, time_s: float) -> None:
    for sites in plan.sites:
        colors = sites.colors.at(time_s) or []
        for name, (x, y), half, color in zip(sites.names, sites.at_m.tolist(), sites.half_m.tolist(), colors,
                                             strict=True):
            px, py = place.at(x, y)
            size = half * place.scale
            if sites.kind == "poi":
                canvas.disc((px, py), size, color, outline=_INK)
            else:
                turn = math.pi / 4 if sites.kind == "base" else 0.0
                canvas.polygon(_box(place, (x, y, half, half, turn)), color)
            canvas.text((px, py + size + 2), name, 12, _INK, align="middle", halo=True)


def _even(length: float) -> int:
    """The next even number of pixels, which videos want."""
    return 2 * math.ceil(length / 2)


def _extent(plan: ShownPlan) -> tuple[float, float, float, float]:
    """Least x, y, greatest x, y [m] of floor and walls, which stand about it."""
    reach = plan.boxes[:, 2:3] * np.abs(np.stack([np.cos(plan.boxes[:, 4]), np.sin(plan.boxes[:, 4])], axis=1)) \
        + plan.boxes[:, 3:4] * np.abs(np.stack([np.sin(plan.boxes[:, 4]), np.cos(plan.boxes[:, 4])], axis=1))
    x0, y0, x1, y1 = plan.bounds_m
    low = np.vstack([plan.boxes[:, :2] - reach, [[x0, y0]]]).min(axis=0).tolist()
    high = np.vstack([plan.boxes[:, :2] + reach, [[x1, y1]]]).max(axis=0).tolist()
    return low[0], low[1], high[0], high[1]


def _named(plan: ShownPlan, place: _Place, time_s: float) -> list[tuple[Pixel, list[str]]]:
    """Names of robots and where they are [px]; those of robots in one place together."""
    found: list[tuple[Pixel, list[str]]] = []
    for robot in plan.robots:
        x, y, _ = robot.pose_at(time_s)
        at = place.at(x, y)
        here = next((names for other, names in found if math.dist(at, other) < _TOGETHER_PX), None)
        if here is None:
            found.append((at, [robot.name]))
        else:
            here.append(robot.name)
    return found


def _mark(canvas: Canvas, at: Pixel, mark: FilmMark, color: Color) -> None:
    """A mark of the legend."""
    r = 5
    match mark:
        case "disc":
            canvas.disc(at, r, color, outline=_INK)
        case "cross":
            _cross(canvas, at, r, color)
        case "line" | "dash":
            for start, end in [(-r, r)] if mark == "line" else [(-r, -0.2 * r), (0.4 * r, 1.2 * r)]:
                canvas.line([(at[0] + start, at[1]), (at[0] + end, at[1])], color, 2)
        case "square" | "diamond":
            square, diamond = [(-r, -r), (r, -r), (r, r), (-r, r)], [(0, -r), (r, 0), (0, r), (-r, 0)]
            corners = square if mark == "square" else diamond
            canvas.polygon([(at[0] + dx, at[1] + dy) for dx, dy in corners], color)


def _robot(canvas: Canvas, robot: ShownRobot, place: _Place, time_s: float) -> None:
    x, y, yaw = robot.pose_at(time_s)
    px, py = place.at(x, y)
    color = (robot.colors.at(time_s) or [robot.color])[0]
    reach = max(max(hx, hy) for (_, _, hx, hy, _), _ in robot.footprint)
    swell = max(_LEAST_PX / (reach * place.scale), 1.0)  # small in a large world, it is shown larger
    for (sx, sy, hx, hy, turn), is_round in robot.footprint:
        cx = x + swell * (sx * math.cos(yaw) - sy * math.sin(yaw))
        cy = y + swell * (sx * math.sin(yaw) + sy * math.cos(yaw))
        if is_round:
            canvas.disc(place.at(cx, cy), hx * swell * place.scale, color, outline=_PAPER)
        else:
            canvas.polygon(_box(place, (cx, cy, hx * swell, hy * swell, yaw + turn)), color, _PAPER)
    ahead = reach * swell * place.scale
    canvas.line([(px, py), (px + ahead * math.cos(yaw), py - ahead * math.sin(yaw))], _PAPER, 2)
    if robot.lost is not None and time_s >= robot.lost[0]:
        _cross(canvas, (px, py), 1.8 * max(ahead, _LEAST_PX), ALARM)


def _box(place: _Place, box: tuple[float, float, float, float, float]) -> list[Pixel]:
    x, y, hx, hy, yaw = box
    c, s = math.cos(yaw), math.sin(yaw)
    return [place.at(x + dx * hx * c - dy * hy * s, y + dx * hx * s + dy * hy * c)
            for dx, dy in ((-1, -1), (1, -1), (1, 1), (-1, 1))]


def _cross(canvas: Canvas, at: Pixel, r: float, color: Color) -> None:
    x, y = at
    for dy in (r, -r):
        canvas.line([(x - r, y - dy), (x + r, y + dy)], _PAPER, 6)
    for dy in (r, -r):
        canvas.line([(x - r, y - dy), (x + r, y + dy)], color, 3)


def _line(canvas: Canvas, place: _Place, ends: list[list[float]], color: Color, width: float) -> None:
    canvas.line([place.at(*end) for end in ends], color, width)


def moments(end_s: float, frames: int) -> FloatArray:
    """Moments of so many frames, from the start to the end of a mission [s]."""
    return np.linspace(0.0, end_s, frames)
