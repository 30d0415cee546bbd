"""Files that a world names: their allowed locations, and their content as read."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from sva_bench.errors import BadFile
from sva_bench.files.documents import read_bytes

MAX_BYTES = 100_000_000  # more than 16 million numbers in ASCII
WIDEST_M, FARTHEST_M = 2000.0, 1e5  # greatest width of a world, and distance from its origin, as for shapes


@dataclass(frozen=True, eq=False, kw_only=True)
class MapFile:
    """A file that a world names, directly or through another file.

    Attributes:
        name: Relative to the world's folder, with slashes.
        content: Its bytes as read.
    """

    name: str
    content: bytes


def locate(root: Path, name: str) -> Path:
    """The path of a file named relative to a folder, which must not be left by ``..`` or by a link.

    Raises:
        BadFile: If it is outside the folder, or no file.
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
    """A relative name in normal form, with slashes."""
    return str(PurePosixPath(os.path.normpath(name)))


def content_of(path: Path) -> bytes:
    """The content of a map's file.

    Raises:
        BadFile: If it cannot be read, or is larger than ``MAX_BYTES``.
    """
    return read_bytes(path, MAX_BYTES)
