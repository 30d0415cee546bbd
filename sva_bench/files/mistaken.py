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


def _article(word: str) -> str:
    return "an" if word[0] in "aeiou" else "a"
