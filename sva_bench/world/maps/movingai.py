"""Octile maps of MovingAI."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from sva_bench.errors import BadFile
from sva_bench.files.fields import Positive
from sva_bench.files.printable import counted
from sva_bench.geometry.cells import Cells
from sva_bench.world.maps.files import WIDEST_M, MapFile, content_of, locate, normal
from sva_bench.world.maps.images import MAX_CELLS
from sva_bench.world.maps.section import MapSection

_FREE_TERRAIN, _SOLID_TERRAIN = b".GS", b"@OTW"


class MovingAiMap(MapSection):
    """An octile map of the MovingAI benchmarks."""

    cell_m: Annotated[Positive, Field(ge=1e-3, le=100)] = 1.0

    def read(self, root: Path, *, anywhere: bool = False) -> tuple[Cells, tuple[MapFile, ...]]:  # noqa: ARG002
        return read_movingai_map(root, self.file, self.cell_m)


def read_movingai_map(root: Path, name: str, cell_m: float) -> tuple[Cells, tuple[MapFile, ...]]:
    """Read an octile map of the MovingAI benchmarks; its first row is the northernmost.

    Robots drive on ``.``, ``G`` and swamp ``S``; trees ``T``, water ``W`` and ``@``, ``O`` are solid.

    Raises:
        BadFile: With file, line and what to change.

    Source:
        Sturtevant (2012), Benchmarks for grid-based pathfinding, and the format's description there.
    """
    path = locate(root, name)
    content = content_of(path)
    # An editor's byte-order mark is no part of the text, and no more lines are split than there may be rows.
    lines = content.removeprefix(b"\xef\xbb\xbf").split(b"\n", MAX_CELLS + 4)
    lines = [line.removesuffix(b"\r") for line in lines]
    while lines and not lines[-1].strip():
        lines.pop()
    if not lines or lines[0].split() != [b"type", b"octile"]:
        raise BadFile(path, 1, "", "expected 'type octile', the first line of a MovingAI map")
    size: dict[str, int] = {}
    for number in (1, 2):
        words = lines[number].split() if number < len(lines) else []
        if len(words) != 2 or words[0] not in (b"height", b"width") or not words[1].isdigit() or len(words[1]) > 9:
            raise BadFile(path, number + 1, "", "expected 'height' and 'width' with an integer each")
        size[words[0].decode()] = int(words[1])
    if len(size) != 2:
        raise BadFile(path, 3, "", "expected 'height' and 'width', each once")
    rows, columns = size["height"], size["width"]
    if min(rows, columns) < 1 or rows * columns > MAX_CELLS:
        raise BadFile(path, 2, "", f"{columns} x {rows} cells; expected at least one, and at most {MAX_CELLS}")
    if max(rows, columns) * cell_m > WIDEST_M:
        raise BadFile(path, 2, "", f"{columns} x {rows} cells of {cell_m} m; a world may be at most {WIDEST_M:g} m "
                      "wide: choose a smaller cell_m")
    if len(lines) < 4 or lines[3].strip() != b"map":
        raise BadFile(path, 4, "", "expected 'map', and then the rows")
    body = lines[4:]
    if len(body) != rows:
        raise BadFile(path, len(lines), "", f"expected {counted(rows, 'row')} below 'map', as 'height' says, "
                      f"found {len(body)}")
    for number, line in enumerate(body, start=5):
        if len(line) != columns:
            raise BadFile(path, number, "", f"expected {counted(columns, 'cell')}, as 'width' says, found {len(line)}")
    letters = np.frombuffer(b"".join(body), dtype=np.uint8).reshape(rows, columns)
    free = np.isin(letters, np.frombuffer(_FREE_TERRAIN, dtype=np.uint8))
    strange = ~(free | np.isin(letters, np.frombuffer(_SOLID_TERRAIN, dtype=np.uint8)))
    if strange.any():
        row, column = np.argwhere(strange)[0].tolist()
        raise BadFile(path, row + 5, "", f"column {column + 1}: {chr(letters[row, column])!r} is no terrain; expected "
                      "one of . G S @ O T W")
    if not free.any():
        raise BadFile(path, None, "", f"no cell of the map is free: all {free.size} are solid (one of @ O T W)")
    cells = Cells(occupied=~free[::-1], cell_m=cell_m, origin=np.zeros(3))
    return cells, (MapFile(name=normal(name), content=content),)
