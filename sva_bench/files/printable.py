"""Foreign text made fit to be shown: names in files from elsewhere, names of files, what was typed."""

from __future__ import annotations

import re
from typing import Any

_OBEYED = re.compile(  # controls but for line feed and tab; marks that turn the direction of writing; half characters
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


def printable(text: str) -> str:
    """The text, with what a terminal would obey or cannot show spelt out: an escape is ``\\x1b``.

    Bytes of a file name that are no UTF-8 are shown as what they are.
    """
    return text if text.isascii() and text.isprintable() else _OBEYED.sub(_spelt, text)


def _spelt(found: re.Match[str]) -> str:
    code = ord(found[0])
    if 0xDC80 <= code <= 0xDCFF:  # as Python keeps such a byte
        code -= 0xDC00
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"


def is_text(name: str) -> bool:
    """Whether a name can be written as UTF-8."""
    return not any("\ud800" <= letter <= "\udfff" for letter in name)


def is_name(name: str) -> bool:
    """Whether a name can stand in tables, charts and pages as it is: it is text, of one line."""
    return printable(name) == name and not {"\n", "\t"} & set(name)


def all_text(data: Any) -> bool:
    """Whether all words in JSON data can be written as UTF-8."""
    if isinstance(data, dict):
        return all(is_text(key) and all_text(item) for key, item in data.items())
    if isinstance(data, list):
        return all(map(all_text, data))
    return not isinstance(data, str) or is_text(data)


def counted(count: int, noun: str, plural: str | None = None) -> str:
    """``1 map``, ``2 maps``."""
    return f"{count} {noun if count == 1 else plural or noun + 's'}"
