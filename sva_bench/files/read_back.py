"""Reading of this program's own documents: bounded in size, and validated whatever their origin."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from sva_bench.errors import BadFile
from sva_bench.files.documents import Document, read_json, validate
from sva_bench.files.records import FormT

MOST_BYTES = 50_000_000
"""Greatest size of a summary, a manifest or a list of failures; in memory it takes about ten times as much."""


def read_ours(path: Path, schema: type[FormT], kind: str) -> tuple[Document, FormT]:
    """A document, as read and as validated.

    Raises:
        BadFile: If it is missing, too large or invalid.
    """
    document = read_json(path, MOST_BYTES)
    return document, validate(document, schema, kind)


class Part(Document):
    """A part of a document that is a document itself; errors are located in the whole."""

    def __init__(self, whole: Document, at: tuple[str | int, ...], data: Any) -> None:
        super().__init__(whole.path, data, json.dumps(data))
        self._whole, self._at = whole, at

    def error(self, loc: tuple[str | int, ...], problem: str) -> BadFile:
        """An error about the value at ``loc`` of this part."""
        return self._whole.error((*self._at, *loc), problem)
