"""Records: frozen dataclasses that are validated when read from files, and written as plain data.

Code uses them as any dataclass; only here are they converted from and to mappings. A field whose default is
``None`` or empty is omitted from the file when it has that value.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import MISSING, Field, fields
from typing import Any, TypeVar

import numpy as np
from pydantic import ConfigDict, TypeAdapter

FormT = TypeVar("FormT")


class Record:
    """A part of a document; an unknown key in it is an error."""

    __pydantic_config__ = ConfigDict(extra="forbid")


def stands_after(key: str) -> dict[str, str]:
    """Metadata of a subclass's field: in files it follows this key, not all those of the base class."""
    return {"after": key}


def as_dict(record: Record) -> dict[str, Any]:
    """A record as the content of a file: mappings, lists and plain values."""
    form: Any = type(record)
    return {item.name: _plain(getattr(record, item.name)) for item in _in_order(form)
            if not _left_out(item, getattr(record, item.name))}


def from_dict(form: type[FormT], data: Any) -> FormT:
    """The record, or the pydantic model, of a file's data.

    Raises:
        ValidationError: If the data are invalid.
    """
    known: Any = form
    record: FormT = _adapter(known).validate_python(data)
    return record


def _plain(value: Any) -> Any:
    if isinstance(value, Record):
        return as_dict(value)
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return value.tolist()
    return float(value) + 0.0 if isinstance(value, float) else value  # no minus zero


def _left_out(item: Field[Any], value: Any) -> bool:
    if item.default is None:
        return value is None
    return item.default_factory is not MISSING and not value


@functools.cache
def _in_order(form: Any) -> tuple[Field[Any], ...]:
    ordered: list[Field[Any]] = []
    for item in fields(form):
        names = [other.name for other in ordered]
        after = item.metadata.get("after")
        ordered.insert(len(names) if after is None else names.index(after) + 1, item)
    return tuple(ordered)


@functools.cache
def _adapter(form: Any) -> TypeAdapter[Any]:
    return TypeAdapter(form)
