"""Entities written into a recording, below a path of their own."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from sva_bench.arrays import FloatArray
from sva_bench.recording.colors import Color

TIMELINE = "sim_time"
_NAMES: Color = (255, 255, 255)  # the viewer writes them on dark shields


@dataclass(frozen=True, eq=False, kw_only=True)
class Pen:
    """What writes entities below a path; the arguments of its methods are paths from there.

    Attributes:
        stream: The recording.
        below: The path, with a slash at its end; nothing = the root.
    """

    stream: rr.RecordingStream
    below: str = ""

    def column(self, entity: str, time_s: Iterable[float] | FloatArray, columns: Iterable[rr.ComponentColumn]
               ) -> None:
        """Write what an entity is at some times [s]."""
        # Rounded here: rerun cuts off, and 0.29 s would become 0.289999999 s.
        nanoseconds = np.round(np.asarray(time_s, dtype=np.float64) * 1e9).astype("timedelta64[ns]")
        self.stream.send_columns(f"{self.below}{entity}", [rr.TimeColumn(TIMELINE, duration=nanoseconds)], columns,
                                 strict=True)

    def constant(self, entity: str, *shapes: rr.AsComponents) -> None:
        """Write what an entity is all the time."""
        self.stream.log(f"{self.below}{entity}", *shapes, static=True, strict=True)

    def names(self, entity: str, names: Sequence[str] | None = None, at_m: NDArray[np.floating[Any]] | None = None
              ) -> None:
        """Names, each just below its point; labels of solids would have the solid's colour, and be hard to read.

        Args:
            entity: Its path.
            names: The names; ``None`` = they are written as a column.
            at_m: Their points; ``None`` = likewise.
        """
        self.constant(entity, rr.Points3D.from_fields(
            positions=at_m, radii=rr.Radius.ui_points(0.0), colors=[_NAMES], labels=names, show_labels=True))


def part(name: str) -> str:
    """A name as one part of an entity's path, whatever it holds."""
    return str(rr.escape_entity_path_part(name))
