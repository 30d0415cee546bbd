"""Files of another kind than expected: what they are, and which command reads them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

_COMMANDS = {
    "world": "`sva-bench run` takes worlds, and `sva-bench times` makes an instance of one",
    "instance": "`sva-bench plan` and `sva-bench certify` take instances",
    "plan": "`sva-bench execute WORLD PLAN` and `sva-bench certify INSTANCE PLAN` take plans",
    "sweep": "`sva-bench batch` takes sweeps",
    "summary": "`sva-bench report` takes the run's folder",
    "manifest": "`sva-bench report` takes the run's folder",
    "batch-manifest": "`sva-bench batch status` takes the batch's folder",
}
_FROM_MAP = "`sva-bench world from-map MAP -o WORLD.yaml` makes a world of it"


def what_it_is(data: Any) -> str | None:
    """A description of a document of another kind, with the command that reads it; ``None`` if it is unknown."""
    if isinstance(data, str):  # text that YAML reads as one multi-line scalar
        return describe_text(data)
    if not isinstance(data, Mapping):
        return None
    form = data.get("format")
    if isinstance(form, str) and form.startswith("sva-bench/"):
        kind = form.removeprefix("sva-bench/").partition("@")[0]
        return f"this is {_article(kind)} {kind.replace('-', ' ')}: {_COMMANDS[kind]}" if kind in _COMMANDS else None
    if form is None and "image" in data and "resolution" in data:
        return f"this is a ROS map: {_FROM_MAP}"
    return None


def describe_text(text: str) -> str | None:
    """A description of text that is neither YAML nor JSON, by its beginning; ``None`` if it is unknown."""
    return f"this is a MovingAI map: {_FROM_MAP}" if text.lstrip().startswith("type octile") else None


def describe_yaml_error(text: str, number: int, problem: str) -> str:
    """The message for text that is no valid YAML, with what to change where that is known.

    Args:
        text: The text.
        number: The line at which the parser stopped, counted from 0.
        problem: The parser's message.
    """
    line = "".join(text.split("\n")[number:number + 1])
    if "\t" in line[:len(line) - len(line.lstrip())]:
        return "not valid YAML: a tab indents this line; write spaces in its place"
    if "another document" in problem:
        return "not valid YAML: a second document begins here ('---'); a file holds one: remove one, or make two files"
    return f"not valid YAML: {problem}"


def describe_bytes(content: bytes) -> str | None:
    """A description of a binary file, by its signature; ``None`` if it is unknown."""
    kind = next((kind for start, kind in _SIGNATURES.items() if content.startswith(start)), None)
    if kind is None and content.startswith(b"BM") and b"\0" in content[:16]:
        kind = "BMP"
    if kind is not None:
        return f"this is a {kind} image, no text: name the YAML file of the world or map that it belongs to"
    other = next((kind for start, kind in _OTHERS.items() if content.startswith(start)), None)
    return None if other is None else f"this is a {other} file, no text: name a YAML or JSON file"


_SIGNATURES = {b"\x89PNG\r\n\x1a\n": "PNG", b"\xff\xd8\xff": "JPEG", b"GIF8": "GIF", b"P5\n": "PGM", b"P2\n": "PGM",
               b"P5 ": "PGM", b"P2 ": "PGM", b"P6\n": "PPM", b"P3\n": "PPM", b"II*\0": "TIFF", b"MM\0*": "TIFF"}
_OTHERS = {b"PAR1": "Parquet", b"PK\x03\x04": "ZIP", b"\x1f\x8b": "gzip", b"%PDF": "PDF", b"RRF2": "Rerun"}


def _article(word: str) -> str:
    return "an" if word[0] in "aeiou" else "a"
