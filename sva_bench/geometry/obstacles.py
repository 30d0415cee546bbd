"""Obstacles as arrays."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from sva_bench.arrays import FloatArray, frozen
from sva_bench.geometry.cells import Cells
from sva_bench.seeds import key_of


@dataclass(frozen=True, eq=False, kw_only=True)
class Obstacles:
    """All obstacles of a world.

    Attributes:
        bounds_m: x_min, y_min, x_max, y_max [m], surrounded by walls; shape (4,).
        boxes: Centre x, y, half length, half width [m], yaw [rad]; shape (k, 5). Walls are boxes too.
        cylinders: Centre x, y, radius [m]; shape (c, 3).
        cells: The occupancy grid that ``boxes`` cover exactly; ``None`` for obstacles given as shapes.
        floors: Patches of floor that are no obstacles but grip less: as ``boxes``, then the friction; shape (f, 6).
            Where they overlap the last counts.
    """

    bounds_m: FloatArray
    boxes: FloatArray
    cylinders: FloatArray
    cells: Cells | None = None
    floors: FloatArray = field(default_factory=lambda: np.empty((0, 6)))

    def __post_init__(self) -> None:
        object.__setattr__(self, "bounds_m", frozen(self.bounds_m, (4,)))
        object.__setattr__(self, "boxes", frozen(self.boxes, (None, 5)))
        object.__setattr__(self, "cylinders", frozen(self.cylinders, (None, 3)))
        object.__setattr__(self, "floors", frozen(self.floors, (None, 6)))

    def key(self) -> tuple[int, ...]:
        """Key of random streams for these obstacles; other obstacles have other streams."""
        if self.cells is not None:  # independent of how boxes cover them
            cells = self.cells
            return key_of(np.packbits(cells.occupied).tobytes(), repr(cells.occupied.shape),
                          repr(np.append(cells.origin, cells.cell_m).tolist()))
        return key_of(*(repr(part.tolist()) for part in (self.bounds_m, self.boxes, self.cylinders)))

    def walled(self, thickness_m: float) -> Obstacles:
        """The same obstacles with the walls around the bounds as the first four boxes.

        Args:
            thickness_m: Thickness of these walls [m].
        """
        x0, y0, x1, y1 = self.bounds_m.tolist()
        cx, cy, hx, hy, t = (x0 + x1) / 2, (y0 + y1) / 2, (x1 - x0) / 2, (y1 - y0) / 2, thickness_m / 2
        walls = [(x0 - t, cy, t, hy + 2 * t, 0.0), (x1 + t, cy, t, hy + 2 * t, 0.0),
                 (cx, y0 - t, hx + 2 * t, t, 0.0), (cx, y1 + t, hx + 2 * t, t, 0.0)]
        return replace(self, boxes=np.concatenate([walls, self.boxes]))
