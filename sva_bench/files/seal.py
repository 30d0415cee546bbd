"""Detection of edits in generated world files, so that they are not overwritten."""

from __future__ import annotations

import re
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path

from sva_bench.errors import BadInput

_LINE = re.compile(r"^# as written: ([0-9a-f]{16})\n", re.MULTILINE)
_MOST_BYTES = 16_000_000  # larger files are no worlds
_WORLD = "sva-bench/world"


def sealed(text: str) -> str:
    """The text of a world file with its digest as the last line of the comment at its head."""
    lines = text.splitlines(keepends=True)
    head = next((number for number, line in enumerate(lines) if not line.startswith("#")), len(lines))
    return "".join([*lines[:head], f"# as written: {_digest(text)}\n", *lines[head:]])


def refuse_edited(path: Path, *, force: bool) -> None:
    """Refuse to overwrite a world that was edited since it was generated.

    Args:
        path: Where a world is to be written.
        force: Overwrite it in any case.

    Raises:
        BadInput: If there is a world without a digest, or with the digest of another text.
    """
    if force or not path.is_file():
        return
    try:
        if path.stat().st_size > _MOST_BYTES:
            return
        # Universal newlines: a version control system may have changed the line ends.
        text = path.read_text(encoding="utf-8-sig", errors="replace")
    except OSError:
        return  # unreadable; whether it can be written is checked elsewhere
    if _WORLD not in text:
        return
    found = _LINE.search(text)
    if found is None or found[1] != _digest(_LINE.sub("", text, count=1)):
        raise BadInput(f"{path}: this world was edited since a command wrote it, or written by hand; write over it "
                       "with --force, or choose another name with -o")


def refuse_others(world: Path, files: Mapping[str, bytes]) -> None:
    """Refuse to overwrite a map that belongs to another world: ``a.yaml`` and ``a.yml`` would share ``a-map/``.

    Args:
        world: Where the world is to be written. If it exists already, the map beside it is its own.
        files: Content of its map's files, by their names beside it.

    Raises:
        BadInput: If there is no such world yet, but another map of its name.
    """
    if world.exists():
        return
    for name, content in files.items():
        path = world.parent / name
        if path.is_file() and path.read_bytes() != content:
            raise BadInput(f"{path}: this map belongs to another world; choose another name with -o, or write over it "
                           "with --force")


def _digest(text: str) -> str:
    return sha256(text.encode()).hexdigest()[:16]
