"""Files that a world names: where they may lie, and what they held when they were read."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from sva_bench.errors import BadFile
from sva_bench.files.documents import read_bytes

MAX_BYTES = 100_000_000  # 16 million numbers in ASCII, with room to spare
WIDEST_M, FARTHEST_M = 2000.0, 1e5  # of a world, and from its origin; as for shapes


@dataclass(frozen=True, eq=False, kw_only=True)
class MapFile:
    """A file that a world names, directly or by another one.

    Attributes:
        name: Relative to the world's folder, with slashes.
        content: Its bytes as they were read.
    """

    name: str
    content: bytes


def locate(root: Path, name: str) -> Path:
    """A file by its name relative to a folder, which it may not leave: not by ``..`` and not by a link either.

    Raises:
        BadFile: If it is elsewhere, or no file.
    """
    shown = name if name.isprintable() and len(name) <= 200 else repr(name[:200])
    if not name or "\0" in name:
        raise BadFile(root, None, "", "expected the name of a file")
    if name.startswith(("/", "~")) or "\\" in name:
        raise BadFile(shown, None, "", "no name relative to the world's folder, with slashes; put the file there, and "
                      "name it so")
    path = Path(root, normal(name))
    try:
        inside = path.resolve().is_relative_to(root.resolve())
        if inside and path.is_file():
            return path
        there = path.exists()
    except (OSError, RuntimeError, ValueError):  # a name too long, links in a circle
        inside, there = True, False
    if not inside:
        raise BadFile(shown, None, "", "lies outside the world's folder; copy the file there")
    raise BadFile(shown, None, "", f"{'not a file' if there else 'no such file'} in {root}")


def normal(name: str) -> str:
    return str(PurePosixPath(os.path.normpath(name)))


def content_of(path: Path) -> bytes:
    return read_bytes(path, MAX_BYTES)
