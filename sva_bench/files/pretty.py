"""Readable JSON."""

from __future__ import annotations

import json
from typing import Any

from sva_bench.files.complaints import Loc as Loc


def pretty_json(data: Any, indent: int = 0, width: int = 116) -> str:
    """Readable JSON: values that fit on a line are on one line."""
    flat = json.dumps(data, ensure_ascii=False, allow_nan=False)
    if len(flat) + indent <= width or not isinstance(data, dict | list) or not data:
        return flat + ("\n" if indent == 0 else "")
    pad = " " * (indent + 1)
    if isinstance(data, dict):
        items = [f"{pad}{json.dumps(key)}: {pretty_json(value, indent + 1)}" for key, value in data.items()]
        text = "{\n" + ",\n".join(items) + "\n" + " " * indent + "}"
    else:
        rows = [pad + (json.dumps(item) if not _deep(item) else pretty_json(item, indent + 1)) for item in data]
        text = "[\n" + ",\n".join(rows) + "\n" + " " * indent + "]"
    return text + ("\n" if indent == 0 else "")


def _deep(item: Any) -> bool:
    """Whether an item of a list contains a mapping, or a list of more than scalars."""
    return isinstance(item, dict) or (isinstance(item, list) and any(isinstance(x, dict | list) for x in item))
