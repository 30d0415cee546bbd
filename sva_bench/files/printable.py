"""Untrusted text made safe to print: names in files of any origin, file names, arguments."""

from __future__ import annotations

import re
from typing import Any

_CONTROLS = re.compile(  # control characters but line feed and tab; bidirectional marks; lone surrogates
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


def printable(text: str) -> str:
    """The text with control characters and undisplayable ones escaped, such as ``\\x1b``.

    Bytes of a file name that are no UTF-8 are escaped as bytes.
    """
    return text if text.isascii() and text.isprintable() else _CONTROLS.sub(_escaped, text)


def _escaped(found: re.Match[str]) -> str:
    code = ord(found[0])
    if 0xDC80 <= code <= 0xDCFF:  # as Python keeps such a byte
        code -= 0xDC00
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"


def is_text(name: str) -> bool:
    """Whether a name can be written as UTF-8."""
    return not any("\ud800" <= letter <= "\udfff" for letter in name)


def is_name(name: str) -> bool:
    """Whether a name can be shown in tables, charts and pages unchanged: one line of printable text."""
    return printable(name) == name and not {"\n", "\t"} & set(name)


def all_text(data: Any) -> bool:
    """Whether all strings in JSON data can be written as UTF-8."""
    if isinstance(data, dict):
        return all(is_text(key) and all_text(item) for key, item in data.items())
    if isinstance(data, list):
        return all(map(all_text, data))
    return not isinstance(data, str) or is_text(data)


def shown(value: object) -> str:
    """A value as quoted in messages, truncated."""
    text = "nothing" if value is None else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def counted(count: int, noun: str, plural: str | None = None) -> str:
    """``1 map``, ``2 maps``."""
    return f"{count} {noun if count == 1 else plural or noun + 's'}"
