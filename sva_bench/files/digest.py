"""Content hashes, equal for equal content in any process and on any machine."""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Iterator, Mapping, Set
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sva_bench import __version__
from sva_bench.files.versions import library_versions


def digest(*parts: Any) -> str:
    """SHA-256 of data: plain values, arrays, mappings, sequences, sets, and dataclasses of these.

    Raises:
        TypeError: If a value is of another type.
    """
    hashed = hashlib.sha256()
    for part in parts:
        for piece in _pieces(part):
            hashed.update(piece)
    return hashed.hexdigest()


def _pieces(value: Any) -> Iterator[bytes]:
    """The bytes to hash; each piece is prefixed by its type and length, so that different content differs."""
    if isinstance(value, np.ndarray):
        yield f"a{value.dtype.str}{value.shape}:".encode()
        yield np.ascontiguousarray(value).tobytes()
    elif is_dataclass(value) and not isinstance(value, type):
        yield f"d{type(value).__name__}:{len(fields(value))}:".encode()
        for field in fields(value):
            yield from _pieces(field.name)
            yield from _pieces(getattr(value, field.name))
    elif isinstance(value, Mapping):
        yield f"m{len(value)}:".encode()
        for key in sorted(value):
            yield from _pieces(key)
            yield from _pieces(value[key])
    elif isinstance(value, list | tuple | Set):
        items = sorted(value) if isinstance(value, Set) else value
        yield f"l{len(items)}:".encode()
        for item in items:
            yield from _pieces(item)
    elif value is None or isinstance(value, bool | int | float | str):
        text = (value if isinstance(value, str) else repr(value)).encode()
        yield f"{'s' if isinstance(value, str) else 'v'}{len(text)}:".encode()
        yield text
    else:
        raise TypeError(f"no content hash for {type(value).__name__}")


@functools.cache
def code_digest() -> str:
    """SHA-256 of the package's source and of the versions of the libraries that results depend on."""
    package = Path(__file__).parents[1]
    files = {str(path.relative_to(package)): hashlib.sha256(path.read_bytes()).hexdigest()
             for path in package.rglob("*.py")}
    return hashlib.sha256(json.dumps([__version__, files, library_versions()], sort_keys=True).encode()).hexdigest()
