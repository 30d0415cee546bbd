"""File patterns such as ``maps/**/*.yaml``, with a bound on the entries visited."""

from __future__ import annotations

import fnmatch
import os
import re
from collections.abc import Iterator
from pathlib import Path

from sva_bench.errors import BadInput

MOST_LOOKED_AT = 100_000
"""Most folder entries that a pattern may visit: one or two seconds."""
_MAGIC = re.compile(r"[*?[]")


def has_pattern(path: Path) -> bool:
    """Whether a path holds a pattern."""
    return _MAGIC.search(str(path)) is not None


def matching(pattern: Path, most: int) -> list[Path]:
    """The paths that a pattern matches, sorted: ``*``, ``?``, ``[...]`` within a name, ``**`` for any folders.

    Hidden names are matched only by patterns that begin with a dot; links to folders are not followed by ``**``.

    Raises:
        BadInput: If more than ``most`` match, or too many entries would have to be visited.
    """
    found: set[str] = set()
    walk = _Walk(pattern)
    for path in walk.below(pattern.anchor, pattern.parts[1 if pattern.anchor else 0:]):
        found.add(path)
        if len(found) > most:
            raise BadInput(f"{pattern}: more than {most} files match; narrow the pattern")
    return [Path(path) for path in sorted(found)]


class _Walk:
    """A walk through folders that counts the entries it visits."""

    def __init__(self, pattern: Path) -> None:
        self._pattern, self._seen = pattern, 0

    def below(self, folder: str, parts: tuple[str, ...]) -> Iterator[str]:
        """The paths below a folder that match these parts; an empty name is the current folder."""
        if not parts:
            if folder:
                yield folder
            return
        head, rest = parts[0], parts[1:]
        if not _MAGIC.search(head):
            path = os.path.join(folder, head)
            if os.path.lexists(path) if not rest else os.path.isdir(path):
                yield from self.below(path, rest)
            return
        if head == "**":
            folders = [folder]
            while folders:  # no recursion: folders can be nested deeper than Python's stack
                at = folders.pop()
                yield from self.below(at, rest)
                for entry in self._entries(at):
                    if entry.is_dir(follow_symlinks=False) and not entry.name.startswith("."):
                        folders.append(entry.path if at else entry.name)
                    elif not rest:
                        yield entry.path if at else entry.name
            return
        for entry in self._entries(folder):
            if fnmatch.fnmatchcase(entry.name, head) and (head.startswith(".") or not entry.name.startswith(".")) \
                    and (not rest or entry.is_dir()):
                yield from self.below(entry.path if folder else entry.name, rest)

    def _entries(self, folder: str) -> Iterator[os.DirEntry[str]]:
        try:
            with os.scandir(folder or ".") as entries:
                for entry in entries:
                    self._seen += 1
                    if self._seen > MOST_LOOKED_AT:
                        raise BadInput(f"{self._pattern}: this leads through more than {MOST_LOOKED_AT} files and "
                                       "folders; narrow the pattern")
                    yield entry
        except OSError:  # unreadable, or removed meanwhile: nothing matches
            return
