"""ROS map_server and Nav2 maps as occupancy grids.

Each pixel becomes an occupancy of 0 to 100, or -1 for unknown, exactly as in current Nav2
(``nav2_map_server``, loadMapFromFile): a pixel *at* a threshold counts as occupied, or free; one that is not fully
opaque is unknown, but in raw mode. The map_server of ROS 1 leaves pixels at a threshold unknown, and averages alpha in.
"""

from __future__ import annotations

import json
import logging
import math
import re
from difflib import get_close_matches
from pathlib import Path, PurePosixPath
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from sva_bench.arrays import BoolArray
from sva_bench.choices import MapMode, Unknown
from sva_bench.errors import BadFile, nearest
from sva_bench.files.documents import Document, read_yaml
from sva_bench.files.yaml_text import pretty_yaml
from sva_bench.geometry.cells import Cells
from sva_bench.world.maps.files import FARTHEST_M, WIDEST_M, MapFile, content_of, locate, normal
from sva_bench.world.maps.images import BadImage, GreyImage, grey_image
from sva_bench.world.maps.section import MapSection

_log = logging.getLogger(__name__)


_USUAL_UNKNOWN, _MANY = 205, 1e-3  # the level that map_saver writes for unknown; least share of cells for a warning
_KEYS = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh", "mode")
_MODES: tuple[MapMode, ...] = get_args(MapMode)
_TRUE, _FALSE = ("true", "yes", "on", "1"), ("false", "no", "off", "0")  # YAML 1.1 has all of them, and ROS reads it


class RosMap(MapSection):
    """A map of map_server or Nav2: its YAML file."""

    unknown: Unknown = "occupied"

    def read(self, root: Path, *, anywhere: bool = False) -> tuple[Cells, tuple[MapFile, ...]]:
        return read_ros_map(root, self.file, self.unknown, anywhere=anywhere)

    def written(self) -> dict[str, str | float]:
        return self.model_dump(exclude_defaults=True)


def read_ros_map(
    root: Path, name: str, unknown: Unknown = "occupied", *, anywhere: bool = False
) -> tuple[Cells, tuple[MapFile, ...]]:
    """Read a map of map_server or Nav2.

    Args:
        root: The folder that no file may leave.
        name: The map's YAML file, relative to it.
        unknown: Whether cells that are neither occupied nor free count as occupied or free.
        anywhere: Whether the image may be outside the folder. The returned files are consistent in any case: the YAML
            file names the image beside it.

    Returns:
        The grid; and the files that were read, the YAML file first.

    Raises:
        BadFile: With file, line, key and what to change.
    """
    path = locate(root, name)
    document = read_yaml(path)
    if not isinstance(document.data, dict):
        raise document.error((), "expected a map's keys: image, resolution, origin, ...")
    elsewhere = _elsewhere(document, root, path) if anywhere else None
    image_name = _image_name(document, name, elsewhere)
    cell_m = _number(document, "resolution", 1e-4, 100.0)
    origin = _origin(document)
    negate = _flag(document, "negate")
    occupied, free = (_number(document, key, 0.0, 1.0) for key in ("occupied_thresh", "free_thresh"))
    if free > occupied:
        raise document.error(("free_thresh",), f"free_thresh {free} is above occupied_thresh {occupied}; exchange them")
    mode = _mode(document)
    try:
        image_path = elsewhere or locate(root, image_name)
    except BadFile as error:
        raise document.error(("image",), f"{error.path}: {error.problem}") from None
    try:
        content = content_of(image_path)
        image = grey_image(content)
    except BadImage as error:
        raise BadFile(image_path, None, "", f"{error} (the image of {path})") from None
    except BadFile as error:
        raise document.error(("image",), f"{error.path}: {error.problem}") from None
    value = occupancy(image, negate=negate, occupied_thresh=occupied, free_thresh=free, mode=mode)
    solid = solid_cells(value, occupied_thresh=occupied, free_thresh=free, unknown=unknown)
    rows, columns = solid.shape
    if max(rows, columns) * cell_m > WIDEST_M:
        raise document.error(("resolution",), f"{columns} x {rows} cells of {cell_m} m; a world may be at most "
                             f"{WIDEST_M:g} m wide")
    if unknown_key := [key for key in document.data if key not in _KEYS]:
        _log.warning("%s: not used: %s", path, ", ".join(map(repr, unknown_key)))
    _warn_of_odd_values(document, image, value, free)
    _refuse_no_free_cell(document, solid, int((value < 100 * occupied).sum()), unknown)
    cells = Cells(occupied=solid[::-1], cell_m=cell_m, origin=np.array(origin),
                  unknown=(solid & (value < 100 * occupied))[::-1])
    own = content_of(path) if elsewhere is None else naming_image(document, PurePosixPath(image_name).name)
    return cells, (MapFile(name=normal(name), content=own), MapFile(name=image_name, content=content))


def _warn_of_odd_values(document: Document, image: GreyImage, value: NDArray[np.int8], free_thresh: float) -> None:
    """Warn of values that are probably mistakes: yaw in degrees, and unknown cells that count as free."""
    path, yaw = document.path, _as_number(document.data["origin"][2]) or 0.0
    if abs(yaw) > 2 * math.pi:
        _log.warning("%s: the origin's yaw is %g, more than a turn: it is in radians; %g degrees are %.6g", path, yaw,
                     yaw, math.radians(yaw))
    doubtful = (image.level == _USUAL_UNKNOWN) & (value == 0)
    if (share := float(doubtful.mean())) >= _MANY:
        _log.warning("%s: %.1f %% of the cells have the grey level %d, which many maps use for unknown, and count as "
                     "free by free_thresh %g; if they are unknown, write free_thresh: 0.196", path, 100 * share,
                     _USUAL_UNKNOWN, free_thresh)


def _refuse_no_free_cell(document: Document, solid: BoolArray, not_occupied: int, unknown: Unknown) -> None:
    if not solid.all():
        return
    otherwise = "negate, the thresholds and mode"
    if not_occupied and unknown == "occupied":
        otherwise = f"whether unknown cells are free (unknown: free; from-map: --unknown free), and {otherwise}"
    raise document.error((), f"no cell of the map is free: {solid.size - not_occupied} are occupied and {not_occupied} "
                         f"unknown; look at {otherwise}")


def naming_image(document: Document, name: str) -> bytes:
    """The text of a map's YAML file with another image: the line is replaced, or the file rewritten."""
    lines = document.text.split("\n")
    at = (document.line(("image",)) or 1) - 1
    ending = re.fullmatch(r"image\s*:\s*[^\s'\"#|>&*{\[][^#]*?(\s*#.*)?|image\s*:\s*(?:'[^']*'|\"[^\"]*\")(\s*#.*)?",
                          lines[at])
    if ending is None or (at + 1 < len(lines) and lines[at + 1][:1].isspace() and lines[at + 1].strip()):
        return pretty_yaml({**document.data, "image": name}, {}).encode()
    lines[at] = f"image: {json.dumps(name, ensure_ascii=False)}{ending[1] or ending[2] or ''}"
    return "\n".join(lines).encode()


def occupancy(
    image: GreyImage, *, negate: bool, occupied_thresh: float, free_thresh: float, mode: MapMode
) -> NDArray[np.int8]:
    """Occupancy of each pixel, 0 to 100 or -1 for unknown, as in current Nav2, in single precision."""
    if mode == "raw":
        return np.where(image.level <= 100, image.level.astype(np.int16), -1).astype(np.int8)
    shade = image.level.astype(np.float32) / np.float32(255)
    dark = shade if negate else np.float32(1) - shade
    low, high = np.float32(free_thresh), np.float32(occupied_thresh)
    value = np.full(dark.shape, -1, dtype=np.int8)
    value[dark >= high] = 100
    value[dark <= low] = 0
    if mode == "scale":
        between = (dark > low) & (dark < high)
        scaled = (dark[between] - low) / np.float32(occupied_thresh - free_thresh) * np.float32(100)
        value[between] = np.floor(scaled + np.float32(0.5)).astype(np.int8)
    if image.opaque is not None:
        value[~image.opaque] = -1
    return value


def solid_cells(
    value: NDArray[np.int8], *, occupied_thresh: float, free_thresh: float, unknown: Unknown
) -> BoolArray:
    """Which cells are obstacles: the occupied ones, and by default all that aren't known to be free.

    Occupancies between 0 and 100, of scale and raw mode, are compared with the thresholds again: in between a cell is
    neither occupied nor free, as it would be in trinary mode.
    """
    if unknown == "free":
        result: BoolArray = value >= 100 * occupied_thresh
    else:
        result = (value < 0) | (value > 100 * free_thresh) | (value >= 100)
    return result


def _image_of(document: Document) -> str:
    image = _value(document, "image")
    if not isinstance(image, str) or not image.strip() or "\0" in image:
        raise document.error(("image",), "expected the name of a PGM, PNG or BMP file")
    return image


def _elsewhere(document: Document, root: Path, path: Path) -> Path | None:
    """The path of the image, if it is outside the folder; else ``None``."""
    image = Path(path.parent, _image_of(document))
    try:
        if image.resolve().is_relative_to(root.resolve()):
            return None
        there, regular = image.exists(), image.is_file()
    except (OSError, RuntimeError, ValueError):
        there = regular = False
    if not regular:
        raise document.error(("image",), f"{image}: {'not a file' if there else 'no such file'}")
    return image


def _image_name(document: Document, yaml_name: str, elsewhere: Path | None) -> str:
    image = _image_of(document) if elsewhere is None else elsewhere.name
    if elsewhere is None and image.startswith(("/", "~")):
        raise document.error(("image",), f"{image[:200]!r} is an absolute path; put the image beside this file and "
                             "name it without folders")
    return normal(str(PurePosixPath(yaml_name).parent / image))


def _value(document: Document, key: str) -> object:
    if document.data.get(key) is None:
        for unknown_key in document.data:
            if unknown_key not in _KEYS and get_close_matches(str(unknown_key)[:200], [key], cutoff=0.7):
                raise document.error((unknown_key,), f"unknown key {unknown_key!r}; did you mean {key!r}?")
        raise document.error((key,), f"the key {key!r} is missing; add it, as map_server writes it")
    value: object = document.data[key]
    return value


def _as_number(value: object) -> float | None:
    """A finite number, or text of one, which ROS's YAML readers accept; else ``None``."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return None
    try:
        number = float(value)
    except (ValueError, OverflowError):
        return None
    return number if math.isfinite(number) else None


def _number(document: Document, key: str, low: float, high: float) -> float:
    number = _as_number(_value(document, key))
    if number is None or not low <= number <= high:
        raise document.error((key,), f"expected a number from {low:g} to {high:g}, found {_short(document.data[key])}")
    return number


def _origin(document: Document) -> tuple[float, float, float]:
    value = _value(document, "origin")
    numbers = [_as_number(item) for item in value] if isinstance(value, list) else []
    if len(numbers) != 3 or any(number is None for number in numbers):
        raise document.error(("origin",), f"expected [x, y, yaw] in m and radians, found {_short(value)}")
    x, y, yaw = (number or 0.0 for number in numbers)
    if max(abs(x), abs(y)) > FARTHEST_M or abs(yaw) > 1e3:
        raise document.error(("origin",), f"expected at most {FARTHEST_M:g} m and 1000 radians, found {_short(value)}")
    return x, y, math.remainder(yaw, 2 * math.pi) + 0.0


def _flag(document: Document, key: str) -> bool:
    value = _value(document, key)
    number = _as_number(value)
    text = str(value).lower() if number is None else str(int(number)) if number in (0, 1) else ""
    if text not in _TRUE + _FALSE:
        raise document.error((key,), f"expected 0 or 1, found {_short(value)}")
    return text in _TRUE


def _mode(document: Document) -> MapMode:
    value = document.data.get("mode")
    if value is None:
        return "trinary"
    for mode in _MODES:
        if isinstance(value, str) and value.lower() == mode:
            return mode
    raise document.error(("mode",), f"no mode {_short(value)}; {nearest(str(value), list(_MODES))}")


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
