"""Frames of a video: each plan's map from above, with its robots, what they do, and a clock. The same each time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from sva_bench.arrays import FloatArray
from sva_bench.palette import ALARM, BLACK, GREEN, YELLOW, Color
from sva_bench.recording.colors import pale
from sva_bench.recording.read_back import Shown, ShownPlan, ShownRobot

_OVER = 2  # frames are drawn so many times as large, and made smaller: edges are smooth
_MAP_PX, _PAIR_PX = 900, 640  # greatest side of a map alone, and of one of two
_HEAD_PX, _ROW_PX, _FOOT_PX, _GAP_PX = 44, 24, 30, 16
_PAPER: Color = (255, 255, 255)
_INK: Color = (30, 30, 30)
_FLOOR: Color = (240, 240, 240)
_WALLS: Color = (140, 140, 140)
_LEAST_PX = 7  # radius of a robot, however large the world


@dataclass(frozen=True, kw_only=True)
class _Place:
    """Where a map is in a frame: its corner [px], how many px a metre is, and the floor's corner [m]."""

    left: float
    top: float
    scale: float
    x0_m: float
    y1_m: float

    def at(self, x: float, y: float) -> tuple[float, float]:
        """The pixel of a point."""
        return self.left + (x - self.x0_m) * self.scale, self.top + (self.y1_m - y) * self.scale


class Frames:
    """Draws a recording at any moment."""

    def __init__(self, shown: Shown) -> None:
        self._shown, self._fonts = shown, {size: ImageFont.load_default(size * _OVER) for size in (12, 14, 18)}
        most = _MAP_PX if len(shown.plans) == 1 else _PAIR_PX
        x0, y0, x1, y1 = shown.plans[0].bounds_m
        scale = most / max(x1 - x0, y1 - y0)
        wide, tall = (x1 - x0) * scale, (y1 - y0) * scale
        column = max(wide, 420.0)  # room for the words below
        robots = max(len(plan.robots) for plan in shown.plans)
        self._rows_at = _HEAD_PX + tall + 8 + (_ROW_PX if len(shown.plans) > 1 else 0)
        self.width = _even(len(shown.plans) * (column + _GAP_PX) + _GAP_PX)
        self.height = _even(self._rows_at + (robots + 1) * _ROW_PX + _FOOT_PX)
        self._columns = [_GAP_PX + number * (column + _GAP_PX) for number in range(len(shown.plans))]
        top = _HEAD_PX + (_ROW_PX if len(shown.plans) > 1 else 0)
        self._places = [_Place(left=(left + (column - wide) / 2) * _OVER, top=top * _OVER, scale=scale * _OVER,
                               x0_m=x0, y1_m=y1) for left in self._columns]
        self._still = Image.new("RGB", (self.width * _OVER, self.height * _OVER), _PAPER)
        self._trailed_s = -1.0
        draw = ImageDraw.Draw(self._still)
        self._text(draw, _GAP_PX, 12, shown.title, 18)
        self._legend(draw)
        for plan, place, left in zip(shown.plans, self._places, self._columns, strict=True):
            if plan.name:
                self._text(draw, left, _HEAD_PX, f"{plan.name} plan", 14)
            self._ground(draw, plan, place)

    def at(self, time_s: float) -> Image.Image:
        """The frame of a moment; moments must ascend, for trails only grow.

        Raises:
            ValueError: If they don't.
        """
        if time_s < self._trailed_s:
            raise ValueError(f"moments must ascend: {time_s} s after {self._trailed_s} s")
        still = ImageDraw.Draw(self._still)
        for plan, place in zip(self._shown.plans, self._places, strict=True):
            for robot in plan.robots:
                times, pieces = robot.driven
                for piece in pieces[(times > self._trailed_s) & (times <= time_s)].tolist():
                    _line(still, place, piece, robot.color, 2.2)
        self._trailed_s = time_s
        frame = self._still.copy()
        draw = ImageDraw.Draw(frame)
        minutes, seconds = divmod(int(time_s), 60)
        self._text(draw, self.width - _GAP_PX, 12, f"{minutes}:{seconds:02d}", 18, anchor="ra")
        for plan, place, left in zip(self._shown.plans, self._places, self._columns, strict=True):
            self._sites(draw, plan, place, time_s)
            for robot in plan.robots:
                if time_s >= robot.forgone_s:
                    for stroke in robot.forgone.tolist():
                        _line(draw, place, stroke, robot.color, 2.5)
            for robot in plan.robots:
                _robot(draw, robot, place, time_s)
                x, y, _ = robot.pose_at(time_s)
                px, py = place.at(x, y)
                self._text(draw, px / _OVER, py / _OVER - 26, robot.name, 12, anchor="ma", halo=True)
            self._rows(draw, plan, left, time_s)
        return frame.resize((self.width, self.height), Image.Resampling.BOX)

    def _text(self, draw: ImageDraw.ImageDraw, x: float, y: float, text: str, size: int, *, anchor: str = "la",
              color: Color = _INK, halo: bool = False) -> None:
        draw.text((x * _OVER, y * _OVER), text, fill=color, font=self._fonts[size], anchor=anchor,
                  stroke_width=2 * _OVER if halo else 0, stroke_fill=_PAPER)

    def _ground(self, draw: ImageDraw.ImageDraw, plan: ShownPlan, place: _Place) -> None:
        x0, y0, x1, y1 = plan.bounds_m
        draw.rectangle([place.at(x0, y1), place.at(x1, y0)], fill=_FLOOR, outline=_WALLS, width=_OVER)
        for box in plan.boxes.tolist():
            draw.polygon(_box(place, box), fill=_WALLS)
        for x, y, radius in plan.cylinders.tolist():
            _disc(draw, place.at(x, y), radius * place.scale, _WALLS)
        for robot in plan.robots:
            for dash in robot.planned.tolist():
                _line(draw, place, dash, pale(robot.color), 1.4)

    def _sites(self, draw: ImageDraw.ImageDraw, plan: ShownPlan, place: _Place, time_s: float) -> None:
        for sites in plan.sites:
            colors = sites.colors.at(time_s)
            for name, (x, y), half, color in zip(sites.names, sites.at_m.tolist(), sites.half_m.tolist(), colors,
                                                 strict=True):
                px, py = place.at(x, y)
                size = half * place.scale
                if sites.kind == "poi":
                    _disc(draw, (px, py), size, color, outline=_INK)
                else:
                    turn = math.pi / 4 if sites.kind == "base" else 0.0
                    draw.polygon(_box(place, (x, y, half, half, turn)), fill=color)
                self._text(draw, px / _OVER, (py + size) / _OVER + 2, name, 12, anchor="ma", halo=True)

    def _rows(self, draw: ImageDraw.ImageDraw, plan: ShownPlan, left: float, time_s: float) -> None:
        """A row for each robot: its colour, what it does, what fuel it has left, and what it collected."""
        for number, robot in enumerate(plan.robots):
            y = self._rows_at + number * _ROW_PX
            state = (robot.state.at(time_s) or [""])[0]
            gone = robot.lost is not None and time_s >= robot.lost[0]
            _disc(draw, ((left + 8) * _OVER, (y + 9) * _OVER), 6 * _OVER, robot.color)
            self._text(draw, left + 22, y, robot.name, 14)
            self._text(draw, left + 110, y, state, 14, color=ALARM if gone else _INK)
            if robot.fuel is not None:
                self._text(draw, left + 300, y, f"fuel {np.interp(time_s, *robot.fuel):.0f} s", 14, anchor="ra")
            self._text(draw, left + 410, y, f"{robot.collected.at(time_s) or 0.0:.6g}", 14, anchor="ra")
        if len(plan.robots) > 1:
            y = self._rows_at + len(plan.robots) * _ROW_PX
            self._text(draw, left + 22, y, "collected together", 14)
            self._text(draw, left + 410, y, f"{plan.total.at(time_s) or 0.0:.6g}", 14, anchor="ra")

    def _legend(self, draw: ImageDraw.ImageDraw) -> None:
        x, y = float(_GAP_PX), self.height - _FOOT_PX + 6
        for mark, color, words in (("disc", YELLOW, "POI, the larger the more it is worth"),
                                   ("disc", self._shown.plans[0].robots[0].color, "collected"),
                                   ("cross", ALARM, "lost robot, or POI left by it"),
                                   ("square", GREEN, "refuelling"), ("diamond", BLACK, "base")):
            at = (x + 6) * _OVER, (y + 7) * _OVER
            if mark == "disc":
                _disc(draw, at, 5 * _OVER, color, outline=_INK)
            elif mark == "cross":
                _cross(draw, at, 5 * _OVER, color)
            else:
                r = 5 * _OVER
                square, diamond = [(-r, -r), (r, -r), (r, r), (-r, r)], [(0, -r), (r, 0), (0, r), (-r, 0)]
                corners = square if mark == "square" else diamond
                draw.polygon([(at[0] + dx, at[1] + dy) for dx, dy in corners], fill=color)
            self._text(draw, x + 16, y, words, 12)
            x += 16 + self._fonts[12].getlength(words) / _OVER + 18


def _even(length: float) -> int:
    """The next even number of pixels, which videos want."""
    return 2 * math.ceil(length / 2)


def _robot(draw: ImageDraw.ImageDraw, robot: ShownRobot, place: _Place, time_s: float) -> None:
    x, y, yaw = robot.pose_at(time_s)
    px, py = place.at(x, y)
    color = (robot.colors.at(time_s) or [robot.color])[0]
    reach = max(max(hx, hy) for (_, _, hx, hy, _), _ in robot.footprint)
    swell = max(_LEAST_PX * _OVER / (reach * place.scale), 1.0)  # small in a large world, it is shown larger
    for (sx, sy, hx, hy, turn), is_round in robot.footprint:
        cx = x + swell * (sx * math.cos(yaw) - sy * math.sin(yaw))
        cy = y + swell * (sx * math.sin(yaw) + sy * math.cos(yaw))
        if is_round:
            _disc(draw, place.at(cx, cy), hx * swell * place.scale, color, outline=_PAPER)
        else:
            draw.polygon(_box(place, (cx, cy, hx * swell, hy * swell, yaw + turn)), fill=color, outline=_PAPER)
    ahead = reach * swell * place.scale
    draw.line([(px, py), (px + ahead * math.cos(yaw), py - ahead * math.sin(yaw))], fill=_PAPER, width=2 * _OVER)
    if robot.lost is not None and time_s >= robot.lost[0]:
        _cross(draw, (px, py), 1.8 * max(ahead, _LEAST_PX * _OVER), ALARM)


def _box(place: _Place, box: tuple[float, float, float, float, float]) -> list[tuple[float, float]]:
    x, y, hx, hy, yaw = box
    c, s = math.cos(yaw), math.sin(yaw)
    return [place.at(x + dx * hx * c - dy * hy * s, y + dx * hx * s + dy * hy * c)
            for dx, dy in ((-1, -1), (1, -1), (1, 1), (-1, 1))]


def _disc(draw: ImageDraw.ImageDraw, at: tuple[float, float], radius: float, color: Color,
          outline: Color | None = None) -> None:
    draw.ellipse([at[0] - radius, at[1] - radius, at[0] + radius, at[1] + radius], fill=color, outline=outline,
                 width=_OVER if outline else 0)


def _cross(draw: ImageDraw.ImageDraw, at: tuple[float, float], r: float, color: Color) -> None:
    x, y = at
    for dy in (r, -r):
        draw.line([(x - r, y - dy), (x + r, y + dy)], fill=_PAPER, width=6 * _OVER)
    for dy in (r, -r):
        draw.line([(x - r, y - dy), (x + r, y + dy)], fill=color, width=3 * _OVER)


def _line(draw: ImageDraw.ImageDraw, place: _Place, ends: list[list[float]], color: Color, width: float) -> None:
    draw.line([place.at(*end) for end in ends], fill=color, width=round(width * _OVER))


def moments(end_s: float, frames: int) -> FloatArray:
    """Moments of so many frames, from the start to the end of a mission [s]."""
    return np.linspace(0.0, end_s, frames)
