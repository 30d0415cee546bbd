"""Line numbers of values in a JSON text, by a walk to the value's location."""

from __future__ import annotations

import json
import re

from sva_bench.files.complaints import Loc

_SPACE = re.compile(r"[ \t\n\r]*")
_DECODER = json.JSONDecoder()


def json_line(text: str, loc: Loc) -> int | None:
    """Line of the key at ``loc``, counted from 1; of the nearest parent where it is absent; ``None`` if unreadable."""
    try:
        here = at = _past_space(text, 0)
        for part in loc:
            found = _inside(text, at, part)
            if found is None:
                break
            here, at = found
    except (ValueError, RecursionError):
        return None
    return text.count("\n", 0, here) + 1


def _inside(text: str, at: int, part: str | int) -> tuple[int, int] | None:
    """Offsets of a key (or item) and of its value in the object or list that begins at ``at``; ``None`` if absent."""
    named = text[at:at + 1] == "{"
    if not named and not (text[at:at + 1] == "[" and isinstance(part, int)):
        return None
    end = "}" if named else "]"
    at = _past_space(text, at + 1)
    number = 0
    while text[at:at + 1] != end:
        begin, key = at, ""
        if named:
            key, at = _DECODER.raw_decode(text, at)
            at = _past_space(text, _past_space(text, at) + 1)
        if (key == str(part)) if named else (number == part):
            return begin, at
        _, at = _DECODER.raw_decode(text, at)
        at = _past_space(text, at)
        if text[at:at + 1] == ",":
            at = _past_space(text, at + 1)
        elif text[at:at + 1] != end:
            raise ValueError("neither a comma nor the end")
        number += 1
    return None


def _past_space(text: str, at: int) -> int:
    match = _SPACE.match(text, at)
    return at if match is None else match.end()
