"""Pictures of the PGM family whose numbers are written out, P1 to P3: read here, in little more than their size."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from sva_bench.files.printable import counted

_SPACE = b" \t\r\n\v\f"
_AT_A_TIME = 1 << 20  # bytes
_NUMBER = re.compile(rb"(?:\s|#[^\n\r]*[\n\r])+(\d{1,9})(?!\d)")


def plain_size(content: bytes) -> tuple[int, int] | None:
    """Columns and rows of such a picture; ``None`` if it is none."""
    if content[:2] not in (b"P1", b"P2", b"P3"):
        return None
    (columns, rows), _ = _numbers(content, 2)
    return columns, rows


def plain_levels(content: bytes) -> NDArray[np.float64]:
    """Levels from 0 to 1 of such a picture, shape (rows, columns) or (rows, columns, 3).

    Raises:
        ValueError: If it is broken, in words.
    """
    bitmap, colours = content[:2] == b"P1", 3 if content[:2] == b"P3" else 1
    (columns, rows, *rest), at = _numbers(content, 2 if bitmap else 3)
    most = 1 if bitmap else rest[0]
    if not 1 <= most <= 65535:
        raise ValueError(f"its greatest level is {most}")
    body = content[at:]
    if b"#" in body:
        body = re.sub(rb"#[^\n\r]*", b"", body)
    if strange := body.translate(None, _SPACE + (b"01" if bitmap else b"0123456789")):
        raise ValueError(f"{strange[:1]!r} is no level")
    wanted = columns * rows * colours
    if bitmap:
        found = (49 - np.frombuffer(body.translate(None, _SPACE), dtype=np.uint8)).astype(np.uint16)
    else:
        found = np.empty(min(wanted, len(body)), dtype=np.uint16)
        count = begin = 0
        while begin < len(body) and count < wanted:
            end = begin + _AT_A_TIME
            while end < len(body) and body[end] not in _SPACE:
                end += 1
            numbers = np.array(body[begin:end].split(), dtype="S6")
            levels = numbers.astype(np.int64) if len(numbers) else np.empty(0, dtype=np.int64)
            if (levels > most).any():
                raise ValueError(f"a level of {levels.max()} is above the greatest, {most}")
            part = levels[:wanted - count]
            found[count:count + len(part)] = part
            count, begin = count + len(part), end
        found = found[:count]
    if len(found) < wanted:
        raise ValueError(f"it ends after {len(found)} of {counted(wanted, 'number')}")
    shape = (rows, columns) if colours == 1 else (rows, columns, 3)
    return found[:wanted].reshape(shape) / most


def _numbers(content: bytes, count: int) -> tuple[list[int], int]:
    """The numbers of the head, and where it ends."""
    found, at = [], 2
    for _ in range(count):
        match = _NUMBER.match(content, at)
        if match is None:
            raise ValueError("its head is broken")
        found.append(int(match[1]))
        at = match.end()
    return found, at
