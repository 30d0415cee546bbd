"""Maps written for tests, and the real ones that lie beside the repository."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

SHARED = Path(__file__).parents[2] / "../shared/maps"
YAML = """\
image: {image}
resolution: {resolution}
origin: {origin}
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


def shared_map(name: str) -> Path:
    """A real map; its test is skipped where it is missing."""
    path = SHARED / name
    if not path.exists():
        pytest.skip("the shared maps are not here")
    return path


def write_pgm(path: Path, level: ArrayLike) -> None:
    """A binary PGM; the top row first."""
    pixels = np.asarray(level, dtype=np.uint8)
    path.write_bytes(b"P5\n# made for a test\n%d %d\n255\n" % pixels.shape[::-1] + pixels.tobytes())


def write_ros_map(folder: Path, picture: str, *, resolution: float = 0.5, origin: str = "[0, 0, 0]") -> None:
    """``map.yaml`` and ``map.pgm`` of a drawing: # occupied, . free, ? unknown."""
    levels = {"#": 0, ".": 254, "?": 205}
    write_pgm(folder / "map.pgm", [[levels[c] for c in line] for line in picture.split()])
    (folder / "map.yaml").write_text(YAML.format(image="map.pgm", resolution=resolution, origin=origin))
