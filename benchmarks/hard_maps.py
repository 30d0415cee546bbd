"""Maps that are hard on the search for paths: full of corners, in every way that users bring them.

    python benchmarks/hard_maps.py [NAME ...]

Each map is written with a world of sites all over its largest free region, and given to the commands that a user
would type; printed are its cells, boxes and corners, and what each command takes in processor time and memory.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from sva_bench.arrays import BoolArray, FloatArray
from sva_bench.geometry.cells import Cells, convex_corners, cover, distance_field
from sva_bench.world.places import NoRoom, Places, find_places

CELLS = 1000
RADIUS_M, POIS, STATIONS = 0.177, 20, 4  # of a TurtleBot2; sites as from-map has them by default
CHECK_S, CHECK_MB = 5.0, 1000  # what a check may take

Map = tuple[BoolArray, float]  # occupied cells, and the side of a cell [m]


def _axes(cells: int = CELLS) -> tuple[FloatArray, FloatArray]:
    rows, columns = np.mgrid[:cells, :cells].astype(np.float64)
    return columns, rows


def hatching(angle_deg: float, period: float, width: float, door: float = 0.0, cell_m: float = 0.05) -> Map:
    """Parallel lines; with doors, so that robots get from lane to lane."""
    x, y = _axes()
    turn = math.radians(angle_deg)
    across, along = x * math.cos(turn) + y * math.sin(turn), -x * math.sin(turn) + y * math.cos(turn)
    lines = across % period < width
    if door:
        # Doors of neighbouring lines stand apart, so that ways wind.
        lines &= (along + 97.0 * np.floor(across / period)) % 300 >= door
    return lines, cell_m


def checkerboard(period: int, solid: int, cell_m: float) -> Map:
    """Squares of ``solid`` cells, one every ``period`` cells, every second row shifted by half a period."""
    x, y = _axes()
    shifted = x + (np.floor(y / period) % 2) * (period // 2)
    return (shifted % period < solid) & (y % period < solid), cell_m


def speckles(density: float, cell_m: float, seed: int = 0, within: int = CELLS) -> Map:
    """Single cells at random, everywhere or in one corner only."""
    occupied = np.zeros((CELLS, CELLS), dtype=np.bool_)
    occupied[:within, :within] = np.random.default_rng(seed).random((within, within)) < density
    return occupied, cell_m


def blobs(count: int, size: int, cell_m: float, seed: int = 0) -> Map:
    """Ragged heaps of cells."""
    rng = np.random.default_rng(seed)
    occupied = np.zeros((CELLS, CELLS), dtype=np.bool_)
    for r, c in rng.integers(0, CELLS - size, (count, 2)).tolist():
        occupied[r:r + size, c:c + size] |= rng.random((size, size)) < 0.6
    return occupied, cell_m


def comb(tooth: int, gap: int, cell_m: float = 0.05) -> Map:
    """Teeth from both sides of aisles: many dead ends."""
    x, y = _axes()
    aisle = y % 200 < 20
    return (x % (tooth + gap) < tooth) & ~aisle, cell_m


def spiral(lane: float, cell_m: float = 0.05) -> Map:
    """A round spiral: a wall that turns by a little at each cell."""
    x, y = _axes()
    dx, dy = x - CELLS / 2, y - CELLS / 2
    return (np.hypot(dx, dy) / lane + np.arctan2(dy, dx) / (2 * math.pi)) % 1 < 0.15, cell_m


def rays(count: int, cell_m: float = 0.05) -> Map:
    """Walls that run together in the middle."""
    x, y = _axes()
    dx, dy = x - CELLS / 2, y - CELLS / 2
    far = np.hypot(dx, dy)
    return (np.arctan2(dy, dx) / (2 * math.pi) * count % 1 < 0.3) & (far > 60) & (far % 150 > 30), cell_m


def text(size: int, cell_m: float = 0.05) -> Map:
    """A page full of writing."""
    image = Image.new("1", (CELLS, CELLS), 1)
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(size)
    words = "the quick brown fox jumps over the lazy dog 0123456789 WMNXK &%$ " * 40
    for row, y in enumerate(range(0, CELLS, size + 4)):
        draw.text((-7 * row % 50 - 50, y), words[row:], fill=0, font=font)
    return ~np.asarray(image)[::-1], cell_m


def posts(period: float, radius: float, angle_deg: float = 17.0, cell_m: float = 0.05) -> Map:
    """Round posts on a lattice that stands askew."""
    x, y = _axes()
    turn = math.radians(angle_deg)
    u, v = x * math.cos(turn) + y * math.sin(turn), -x * math.sin(turn) + y * math.cos(turn)
    return np.hypot(u % period - period / 2, v % period - period / 2) < radius, cell_m


def scanned_plan(angle_deg: float = 3.0, noise: float = 0.004, cell_m: float = 0.05) -> Map:
    """Rooms with doors and hatched walls, askew on the paper, with dust."""
    x, y = _axes()
    turn, rng = math.radians(angle_deg), np.random.default_rng(0)
    u, v = x * math.cos(turn) + y * math.sin(turn) + 500, -x * math.sin(turn) + y * math.cos(turn) + 500
    door_u, door_v = (abs(t % 80 - 40) < 14 for t in (u, v))
    walls = ((u % 80 < 7) & ~door_v) | ((v % 80 < 7) & ~door_u)
    hatched = ((u + v) % 8 < 3) & walls
    outline = walls & ~((u % 80 > 1) & (u % 80 < 6) & (v % 80 > 1) & (v % 80 < 6))
    return outline & (hatched | (rng.random(x.shape) < 0.5)) | (rng.random(x.shape) < noise / 10), cell_m


FAMILY: dict[str, Callable[[], Map]] = {
    "plain": lambda: (np.zeros((CELLS, CELLS), dtype=np.bool_), 0.05),
    "hatching-45": lambda: hatching(45, 22, 4, 40),
    "hatching-45-closed": lambda: hatching(45, 22, 4),
    "hatching-30": lambda: hatching(30, 20, 4, 40),
    "hatching-17": lambda: hatching(17, 20, 3, 40),
    "hatching-3": lambda: hatching(3, 20, 3, 40),
    "hatching-45-fine": lambda: hatching(45, 16, 2, 40),
    "hatching-45-large-cells": lambda: hatching(45, 10, 2, 40, 0.2),
    "checkerboard-2": lambda: checkerboard(2, 1, 1.0),
    "checkerboard-5": lambda: checkerboard(5, 1, 0.2),
    "checkerboard-8": lambda: checkerboard(8, 3, 0.1),
    "checkerboard-16": lambda: checkerboard(16, 6, 0.05),
    "checkerboard-20": lambda: checkerboard(20, 1, 0.05),
    "checkerboard-50": lambda: checkerboard(50, 25, 0.05),
    "speckles-sparse": lambda: speckles(0.0005, 0.05),
    "speckles-0.05": lambda: speckles(0.002, 0.05),
    "speckles-0.1": lambda: speckles(0.01, 0.1),
    "speckles-0.2": lambda: speckles(0.045, 0.2),
    "speckles-1": lambda: speckles(0.045, 1.0),
    "speckles-cluster": lambda: speckles(0.3, 0.7, within=400),
    "speckles-small-cluster": lambda: speckles(0.01, 0.1, within=300),
    "noise": lambda: speckles(0.052, 0.5, seed=3),
    "blobs": lambda: blobs(1500, 6, 0.05),
    "blobs-large-cells": lambda: blobs(3000, 8, 0.2),
    "comb": lambda: comb(3, 16),
    "comb-wide": lambda: comb(8, 30),
    "spiral": lambda: spiral(20),
    "spiral-fine": lambda: spiral(15),
    "rays": lambda: rays(90),
    "text-20": lambda: text(20),
    "text-40": lambda: text(40),
    "text-20-large-cells": lambda: text(20, 0.3),
    "posts": lambda: posts(24, 5),
    "posts-fine": lambda: posts(18, 2),
    "posts-large-cells": lambda: posts(10, 3, 17, 0.2),
    "scanned-plan": lambda: scanned_plan(),
    "scanned-plan-dusty": lambda: scanned_plan(noise=0.02),
}


def sites_on(cells: Cells) -> Places | None:
    """Sites as from-map places them; ``None`` where a robot finds no room."""
    field = distance_field(cells)
    for stations, pois in ((STATIONS, POIS), (0, 3)):
        try:
            return find_places(field, base=None, radius_m=RADIUS_M, stations=stations, pois=pois, spacing_m=0.3,
                               seed=0)[0]
        except NoRoom:
            continue
    return None


def write_world(folder: Path, occupied: BoolArray, cell_m: float) -> Path | None:
    """A world of a map, as a user would have it; ``None`` where there is no room for sites."""
    Image.fromarray(np.where(occupied[::-1], 0, 254).astype(np.uint8)).save(folder / "map.png")
    (folder / "map.yaml").write_text(f"image: map.png\nresolution: {cell_m}\norigin: [0, 0, 0]\nnegate: 0\n"
                                     "occupied_thresh: 0.65\nfree_thresh: 0.196\n", encoding="utf-8")
    places = sites_on(Cells(occupied=occupied, cell_m=cell_m, origin=np.zeros(3)))
    if places is None:
        return None
    named = {f"{kind}{k}": at for kind, all_of in (("r", places.stations), ("p", places.pois))
             for k, at in enumerate(all_of)}
    stations, pois = ("\n".join(f"    {name}: {{at_m: [{x}, {y}]}}" for name, (x, y) in named.items()
                                if name[0] == kind) for kind in "rp")
    path = folder / "world.yaml"
    path.write_text(
        "format: sva-bench/world@1\nname: hard\nmap: {ros: {file: map.yaml}}\nsites:\n"
        f"  base: {{at_m: [{places.base[0]}, {places.base[1]}]}}\n  stations:\n{stations}\n  pois:\n{pois}\nrobots:\n"
        "  uv1: {model: turtlebot2, incentives: {uniform: [0, 100], seed: 1}}\n", encoding="utf-8")
    return path


def timed(command: list[str]) -> tuple[float, int, int, str]:
    """Processor time [s], peak memory [MB], exit code and last line of a command."""
    with tempfile.TemporaryFile("w+") as said:
        child = subprocess.Popen(command, stdout=said, stderr=subprocess.STDOUT)
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        said.seek(0)
        lines = said.read().strip().splitlines()
    return used.ru_utime + used.ru_stime, used.ru_maxrss // 1024, child.returncode, lines[-1] if lines else ""


def measure(name: str) -> None:
    """Print what a map of the family takes."""
    occupied, cell_m = FAMILY[name]()
    cells = Cells(occupied=occupied, cell_m=cell_m, origin=np.zeros(3))
    corners = len(convex_corners(cells))
    try:
        boxes = str(len(cover(occupied)))
    except ValueError as error:
        boxes = str(error)
    with tempfile.TemporaryDirectory() as there:
        world = write_world(Path(there), occupied, cell_m)
        if world is None:
            print(f"{name}: {boxes} boxes, {corners} corners: no room for sites", flush=True)
            return
        tool = [sys.executable, "-m", "sva_bench"]
        took, peak, code, last = timed([*tool, "world", "check", str(world)])
        verdict = "" if took <= CHECK_S and peak <= CHECK_MB else "  <-- TOO MUCH"
        print(f"{name}: {cell_m} m, {boxes} boxes, {corners} corners: {took:.1f} s, {peak} MB, exit {code}{verdict}: "
              f"{last[-90:]}", flush=True)


def main() -> None:
    """Print the figures of each map; the first compiles."""
    begun = time.monotonic()
    names = sys.argv[1:] or list(FAMILY)
    for name in names:
        measure(name)
    print(f"{len(names)} maps in {time.monotonic() - begun:.0f} s")


if __name__ == "__main__":
    main()
