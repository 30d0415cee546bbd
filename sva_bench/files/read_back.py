"""Documents of our own read back from a folder: bounded, and checked key by key, wherever the folder came from."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from sva_bench.errors import BadFile
from sva_bench.files.documents import Document, read_json, validate
from sva_bench.files.records import FormT

MOST_BYTES = 50_000_000
"""Of a summary, a manifest or a list of failures; read, it takes some ten times as much memory."""


def read_ours(path: Path, schema: type[FormT], kind: str) -> tuple[Document, FormT]:
    """A document of ours, as read and as checked.

    Raises:
        BadFile: If it is missing, too long, or not as the schema says.
    """
    document = read_json(path, MOST_BYTES)
    return document, validate(document, schema, kind)


class Part(Document):
    """A part of a document that is a document itself; complaints are about the whole."""

    def __init__(self, whole: Document, at: tuple[str | int, ...], data: Any) -> None:
        super().__init__(whole.path, data, json.dumps(data))
        self._whole, self._at = whole, at

    def error(self, loc: tuple[str | int, ...], problem: str) -> BadFile:
        """A complaint about the value at ``loc`` of this part."""
        return self._whole.error((*self._at, *loc), problem)
