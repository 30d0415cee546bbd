"""Files that are something else than is asked for: what they are, and which command takes them."""

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
    """What a document's data are, and which command takes such a thing; ``None`` if nobody knows."""
    if isinstance(data, str):  # a text that YAML takes for one word over many lines
        return what_the_text_is(data)
    if not isinstance(data, Mapping):
        return None
    form = data.get("format")
    if isinstance(form, str) and form.startswith("sva-bench/"):
        kind = form.removeprefix("sva-bench/").partition("@")[0]
        return f"this is {_article(kind)} {kind.replace('-', ' ')}: {_COMMANDS[kind]}" if kind in _COMMANDS else None
    if form is None and "image" in data and "resolution" in data:
        return f"this is a ROS map: {_FROM_MAP}"
    return None


def what_the_text_is(text: str) -> str | None:
    """What a file is that is neither YAML nor JSON, by how it begins."""
    return f"this is a MovingAI map: {_FROM_MAP}" if text.lstrip().startswith("type octile") else None


def what_is_no_yaml(text: str, number: int, problem: str) -> str:
    """What is wrong with text that is no YAML, and what to change where that is known.

    Args:
        text: The text.
        number: The line at which the parser stopped, counted from 0.
        problem: What it says.
    """
    line = "".join(text.split("\n")[number:number + 1])
    if "\t" in line[:len(line) - len(line.lstrip())]:
        return "not valid YAML: a tab indents this line; write spaces in its place"
    if "another document" in problem:
        return "not valid YAML: a second document begins here ('---'); a file holds one: remove one, or make two files"
    return f"not valid YAML: {problem}"


def what_the_bytes_are(content: bytes) -> str | None:
    """What a file is that is no text, by how it begins; ``None`` if nobody knows."""
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
