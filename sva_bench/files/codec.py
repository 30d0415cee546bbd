"""Serialisation of results by their declared types: files are data, never code.

Plain values go into a JSON header, followed by arrays as raw bytes. What is read must be exactly of the expected
type, field by field; anything else is refused. Pickle would run code from a manipulated file.
"""

from __future__ import annotations

import functools
import json
import math
import types
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from typing import Any, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

_LENGTH_BYTES = 8
_DTYPES = {np.float64: "<f8", np.int64: "<i8", np.bool_: "|b1"}


class NotOfType(ValueError):
    """Bytes or a value that are not of the expected type."""


class _Codec(NamedTuple):
    """Encoding of values of one type to JSON data, with arrays appended to a list, and decoding."""

    encode: Callable[[Any, list[bytes]], Any]
    decode: Callable[[Any, _Body], Any]


class _Body:
    """The arrays of a file, read in order."""

    def __init__(self, content: memoryview) -> None:
        self._content, self._at = content, 0

    def take(self, shape: tuple[int, ...], dtype: str) -> np.ndarray[Any, Any]:
        count = math.prod(shape)  # Python integers don't overflow
        end = self._at + count * np.dtype(dtype).itemsize
        if end > len(self._content):
            raise NotOfType("an array is cut off")
        array = np.frombuffer(self._content, dtype=dtype, count=count, offset=self._at).reshape(shape)
        self._at = end
        return array

    def finish(self) -> None:
        if self._at != len(self._content):
            raise NotOfType("there is more than was expected")


def encoded(value: Any, declared_type: Any) -> bytes:
    """A value as bytes.

    Args:
        value: A value of that type.
        declared_type: A dataclass, or a type made of dataclasses, arrays, plain values, tuples, mappings and sets.

    Raises:
        NotOfType: If the value is not of the declared type.
    """
    arrays: list[bytes] = []
    header = json.dumps(_codec(declared_type).encode(value, arrays), separators=(",", ":")).encode()
    return b"".join((len(header).to_bytes(_LENGTH_BYTES, "little"), header, *arrays))


def decoded(content: bytes, declared_type: Any) -> Any:
    """The value that ``encoded`` wrote; its arrays are read-only.

    Raises:
        NotOfType: If the bytes are no value of exactly that type.
    """
    end = _LENGTH_BYTES + int.from_bytes(content[:_LENGTH_BYTES], "little")
    if len(content) < end:
        raise NotOfType("the header is cut off")
    try:
        tree = json.loads(content[_LENGTH_BYTES:end])
        body = _Body(memoryview(content)[end:])
        value = _codec(declared_type).decode(tree, body)
    except RecursionError:
        raise NotOfType("nested too deep") from None
    except ValueError as error:  # no JSON, or figures that a dataclass of ours refuses
        raise NotOfType(str(error)) from None
    body.finish()
    return value


@functools.cache
def _codec(declared_type: Any) -> _Codec:
    """The codec of a type."""
    origin, inner = get_origin(declared_type), get_args(declared_type)
    if is_dataclass(declared_type) and isinstance(declared_type, type):
        return _of_dataclass(declared_type)
    if origin is np.ndarray:
        return _of_arrays(get_args(inner[1])[0])
    if origin is NDArray:  # with a name of its own from NumPy 2.5 on, where Python (3.12) has such aliases
        return _of_arrays(inner[0])
    if origin in (Union, types.UnionType) and len(inner) == 2 and type(None) in inner:
        return _optional(_codec(inner[0] if inner[1] is type(None) else inner[1]))
    if origin is Literal:
        return _plain_codec(lambda value: isinstance(value, str) and value in inner)
    if origin is tuple:
        return _list_of(_codec(inner[0]), tuple) if inner[1:] == (...,) else _row_of([_codec(part) for part in inner])
    if origin is frozenset:
        return _list_of(_codec(inner[0]), frozenset, ordered=sorted)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return _pairs_of(_codec(inner[0]), _codec(inner[1]))
    if declared_type in _PLAIN:
        return _plain_codec(_PLAIN[declared_type])
    raise TypeError(f"no codec for {declared_type}")


def _json_data(value: Any) -> bool:
    """Whether a value survives a JSON round trip unchanged."""
    if isinstance(value, dict):
        return all(type(key) is str and _json_data(item) for key, item in value.items())
    if isinstance(value, list):
        return all(map(_json_data, value))
    return value is None or type(value) in (bool, str) or _number(value)


def _number(value: Any) -> bool:
    """Whether a value is a number but NaN; integers stay integers, so cached results print as new ones do."""
    return type(value) is int or (isinstance(value, float) and not math.isnan(value))


_PLAIN: dict[Any, Callable[[Any], bool]] = {
    str: lambda value: type(value) is str, bool: lambda value: type(value) is bool,
    int: lambda value: type(value) is int, float: _number, Any: _json_data}


def _plain_codec(accepts: Callable[[Any], bool]) -> _Codec:
    def same(value: Any, _: Any) -> Any:
        if not accepts(value):
            raise NotOfType(f"unexpected {type(value).__name__}")
        return value

    return _Codec(same, same)


def _optional(codec: _Codec) -> _Codec:
    return _Codec(lambda value, arrays: None if value is None else [codec.encode(value, arrays)],
                  lambda tree, body: None if tree is None else codec.decode(_list_with(tree, 1)[0], body))


def _list_of(codec: _Codec, kind: type, ordered: Callable[[Any], list[Any]] = list) -> _Codec:
    def encode(value: Any, arrays: list[bytes]) -> list[Any]:
        if not isinstance(value, kind):
            raise NotOfType(f"unexpected {type(value).__name__}")
        return [codec.encode(item, arrays) for item in ordered(value)]

    return _Codec(encode, lambda tree, body: kind(codec.decode(item, body) for item in _list_with(tree)))


def _row_of(codecs: list[_Codec]) -> _Codec:
    def encode(value: Any, arrays: list[bytes]) -> list[Any]:
        if not isinstance(value, tuple) or len(value) != len(codecs):
            raise NotOfType(f"unexpected {type(value).__name__}")
        return [codec.encode(item, arrays) for codec, item in zip(codecs, value, strict=True)]

    return _Codec(encode, lambda tree, body: tuple(
        codec.decode(item, body) for codec, item in zip(codecs, _list_with(tree, len(codecs)), strict=True)))


def _pairs_of(keys: _Codec, values: _Codec) -> _Codec:
    def encode(value: Any, arrays: list[bytes]) -> list[Any]:
        if not isinstance(value, Mapping):
            raise NotOfType(f"unexpected {type(value).__name__}")
        return [[keys.encode(key, arrays), values.encode(item, arrays)] for key, item in value.items()]

    def decode(tree: Any, body: _Body) -> dict[Any, Any]:
        pairs = [_list_with(pair, 2) for pair in _list_with(tree)]
        found = {keys.decode(key, body): values.decode(item, body) for key, item in pairs}
        if len(found) < len(pairs):
            raise NotOfType("a key is a duplicate")
        return found

    return _Codec(encode, decode)


def _of_arrays(scalar: Any) -> _Codec:
    dtype = _DTYPES[scalar]

    def encode(value: Any, arrays: list[bytes]) -> list[int]:
        if not isinstance(value, np.ndarray) or value.dtype != dtype:
            raise NotOfType(f"unexpected {type(value).__name__}")
        arrays.append(value.tobytes())
        return list(value.shape)

    def decode(tree: Any, body: _Body) -> np.ndarray[Any, Any]:
        shape = tuple(_list_with(tree))
        if not all(type(length) is int and length >= 0 for length in shape):
            raise NotOfType("no shape of an array")
        array = body.take(shape, dtype)
        if scalar is np.float64 and np.isnan(array).any():
            raise NotOfType("NaN in an array")
        return array

    return _Codec(encode, decode)


def _of_dataclass(declared_type: Any) -> _Codec:
    hints = get_type_hints(declared_type)
    names = [field.name for field in fields(declared_type)]
    codecs = [_codec(hints[name]) for name in names]

    def encode(value: Any, arrays: list[bytes]) -> list[Any]:
        if type(value) is not declared_type:
            raise NotOfType(f"unexpected {type(value).__name__}")
        return [codec.encode(getattr(value, name), arrays) for name, codec in zip(names, codecs, strict=True)]

    def decode(tree: Any, body: _Body) -> Any:
        items = _list_with(tree, len(names))
        return declared_type(**{
            name: codec.decode(item, body) for name, codec, item in zip(names, codecs, items, strict=True)})

    return _Codec(encode, decode)


def _list_with(tree: Any, length: int | None = None) -> list[Any]:
    if not isinstance(tree, list) or length not in (None, len(tree)):
        raise NotOfType(f"unexpected {type(tree).__name__}")
    return tree
