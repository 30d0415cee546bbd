"""Reading and validation of YAML and JSON files; every error names file, line and key.

Aliases, duplicate keys and oversized files are refused: no valid document needs them, and an alias bomb can exhaust
memory.
"""

from __future__ import annotations

import copy
import json
import math
import os
import stat
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from sva_bench.errors import BadFile, nearest
from sva_bench.files.complaints import Loc as Loc
from sva_bench.files.complaints import dotted, first_complaint
from sva_bench.files.json_lines import json_line
from sva_bench.files.mistaken import describe_bytes, what_it_is
from sva_bench.files.printable import counted, shown
from sva_bench.files.records import FormT, from_dict
from sva_bench.files.yaml_text import MAX_DEPTH, Node, compose, line_in, plain_data, written_in

YAML_SUFFIXES = (".yaml", ".yml")
MAX_YAML_BYTES = 4_000_000  # a world of thousands of obstacles stays below 1 MB
MAX_JSON_BYTES = 200_000_000  # 2000 sites, written with ten digits, stay below 100 MB


class Document:
    """Plain data read from a file, with the line of each key."""

    def __init__(self, path: Path, data: Any, text: str, root: Node | None = None) -> None:
        self.path, self.data, self.text, self._root, self.is_json = path, data, text, root, root is None

    def error(self, loc: Loc, problem: str) -> BadFile:
        """An error about the value at ``loc``, e.g. ``("sites", "pois", "p1")``."""
        return BadFile(self.path, self.line(loc), dotted(loc), problem)

    def line(self, loc: Loc) -> int | None:
        """Line of the key at ``loc``, counted from 1; of the nearest parent where it is absent."""
        if self._root is None:
            return json_line(self.text, loc)
        return line_in(self._root, loc)

    def written(self, loc: Loc) -> str | None:
        """The text of the scalar at ``loc`` of a YAML file; ``None`` if there is none."""
        return None if self._root is None else written_in(self._root, loc)

    def changed(self, key: str, value: Any, named: Mapping[Loc, str] | None = None) -> Document:
        """A copy with another value at a dotted key, e.g. ``robots.uv2.fuel_capacity_s``; lines are those of the file.

        Names may contain dots: the longest existing name is used.

        Args:
            key: The key; missing sections are created.
            value: The value.
            named: Sections whose keys are names given in the file, which are not created; and what they are names of.
        """
        data = copy.deepcopy(self.data)
        at, words = data, key.split(".")
        loc: Loc = ()
        while True:
            name, words = _next_name(at, words)
            if isinstance(at, list) and not (isinstance(name, int) and name < len(at)):
                raise self.error((), f"{key}: there is a list of {counted(len(at), 'item')} at {name!r}; "
                                 "count them from 0")
            if not isinstance(at, dict | list):
                raise self.error((), f"{key}: there is nothing called {name!r} to set")
            if words and loc in (named or {}) and not (isinstance(at, dict) and name in at):
                kind = (named or {})[loc]
                raise self.error((), f"{key}: there is no {kind} {name!r}; {nearest(str(name), list(at))}")
            loc = (*loc, name)
            if not words:
                at[name] = value
                return Document(self.path, data, self.text, self._root)
            at = at.setdefault(name, {}) if isinstance(at, dict) else at[name]


def places_of(data: Any, key: str) -> list[str]:
    """The dotted keys that one with ``*`` in it stands for: of all names, or items of a list, that there are; itself if
    it has none."""
    return [".".join(words) for words in _spread(data, key.split("."))]


def _spread(at: Any, words: list[str]) -> Iterator[list[str]]:
    if "*" not in words:
        yield words
    elif words[0] == "*":
        for name in list(at) if isinstance(at, dict) else range(len(at)) if isinstance(at, list) else ():
            yield from ([str(name), *rest] for rest in _spread(at[name], words[1:]))
    else:
        name, rest = _next_name(at, words)
        if (isinstance(at, dict) and name in at) or (isinstance(at, list) and name in range(len(at))):
            yield from ([str(name), *further] for further in _spread(at[name], rest))


def value_at(data: Any, key: str) -> Any:
    """The value at a dotted key; ``None`` where there is none."""
    words = key.split(".")
    while words:
        name, words = _next_name(data, words)
        if not ((isinstance(data, dict) and name in data) or (isinstance(data, list) and name in range(len(data)))):
            return None
        data = data[name]
    return data


def _next_name(at: Any, words: list[str]) -> tuple[Any, list[str]]:
    """The next name of a dotted key, and the remaining words."""
    if isinstance(at, list):
        return int(words[0]) if words[0].isdecimal() else words[0], words[1:]
    for count in range(len(words), 0, -1):
        name = ".".join(words[:count])
        if isinstance(at, dict) and name in at:
            return name, words[count:]
    return words[0], words[1:]


def read_yaml(path: Path) -> Document:
    """Read a YAML 1.2 file without aliases, tags or duplicate keys.

    Raises:
        BadFile: If it cannot be read, is too large, or is not plain YAML.
    """
    return parse_yaml(_read(path, MAX_YAML_BYTES), path)


def parse_yaml(text: str, path: Path) -> Document:
    """The document of a YAML text, read from ``path`` or about to be written there.

    Raises:
        BadFile: If it is not plain YAML.
    """
    root = compose(text, path)
    if root is None:
        raise BadFile(path, 1, "", "the file is empty")
    return Document(path, plain_data(root, path, ()), text, root)


def read_json(path: Path, most: int = MAX_JSON_BYTES) -> Document:
    """Read a JSON file of at most ``most`` bytes; NaN, infinities and duplicate keys are refused.

    Raises:
        BadFile: If it cannot be read, is too large, or is not JSON.
    """
    text = _read(path, most)

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) < len(pairs):
            keys = [key for key, _ in pairs]
            key = next(key for key in keys if keys.count(key) > 1)
            raise BadFile(path, _last_line_of(text, f'"{key}"'), dotted((key,)), "this key is a duplicate; remove one")
        return found

    def refuse(constant: str) -> float:
        raise BadFile(path, _last_line_of(text, constant), "", f"{constant} is not a number that JSON or we know; "
                      "use null where there is none")

    def finite(literal: str) -> float:
        number = float(literal)
        return number if math.isfinite(number) else refuse(literal[:40])

    try:
        data = json.loads(text, object_pairs_hook=unique, parse_constant=refuse, parse_float=finite)
    except json.JSONDecodeError as error:
        if path.suffix.lower() in (*YAML_SUFFIXES, ".map"):
            known = what_it_is(parse_yaml(text, path).data)
            raise BadFile(path, None, "", "expected JSON, found YAML" + ("" if known is None else f"; {known}")
                          ) from None
        raise BadFile(path, error.lineno, "", f"not valid JSON: {error.msg} (column {error.colno})") from None
    except RecursionError:
        raise BadFile(path, None, "", f"nested deeper than {MAX_DEPTH} levels") from None
    except ValueError as error:  # an integer of more than 4300 digits
        raise BadFile(path, None, "", f"not valid JSON: {error}") from None
    if _deeper_than(data, MAX_DEPTH):
        raise BadFile(path, None, "", f"nested deeper than {MAX_DEPTH} levels")
    return Document(path, data, text)


def _deeper_than(data: Any, levels: int) -> bool:
    layer = [data]
    for _ in range(levels):
        layer = [value for item in layer for value in (item.values() if isinstance(item, dict) else item)
                 if isinstance(value, dict | list)] if isinstance(data, dict | list) else []
        if not layer:
            return False
    return True


def validate(document: Document, schema: type[FormT], kind: str) -> FormT:
    """Check a document against a schema.

    Args:
        document: What was read.
        schema: A record, or a pydantic model.
        kind: The format that the file must declare, e.g. ``sva-bench/world@1``.

    Raises:
        BadFile: For the first error, with file, line, key and what to change.
    """
    check_kind(document, kind)
    try:
        return from_dict(schema, document.data)
    except ValidationError as error:
        written = None if document.is_json else document.written
        raise document.error(*first_complaint(document.data, schema, error, written)) from None


def check_kind(document: Document, kind: str) -> None:
    """Check that a document is a mapping that declares a format.

    Raises:
        BadFile: If it isn't.
    """
    line = f'"format": "{kind}"' if document.is_json else f"'format: {kind}'"
    if not isinstance(document.data, dict):
        raise document.error((), what_it_is(document.data) or f"expected a mapping that starts with {line}")
    found, known = document.data.get("format"), what_it_is(document.data)
    if found is None:
        raise document.error((), known or f"the key 'format' is missing; add {line}")
    if found != kind:
        other = isinstance(found, str) and found.partition("@")[0] != kind.partition("@")[0]
        hint = f"; {known}" if other and known is not None else ""
        raise document.error(("format",), f"expected {kind!r}, found {shown(found)}{hint}")


def read_bytes(path: Path, limit: int) -> bytes:
    """The bytes of a regular file, at most ``limit``; pipes and devices are refused without opening them.

    Raises:
        BadFile: If it is missing, unreadable, too large or no regular file.
    """
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise BadFile(path, None, "", "not a file")
        # The file may have been replaced since: never block on a pipe, never read beyond the limit.
        with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb") as file:
            state = os.fstat(file.fileno())
            if not stat.S_ISREG(state.st_mode):
                raise BadFile(path, None, "", "not a file")
            content = b"" if state.st_size > limit else file.read(limit + 1)
    except FileNotFoundError:
        raise BadFile(path, None, "", "no such file") from None
    except OSError as error:
        raise BadFile(path, None, "", f"cannot be read: {error.strerror}") from None
    except ValueError:  # a name with a null character
        raise BadFile(repr(str(path)), None, "", "no such file") from None
    size = max(state.st_size, len(content))
    if size > limit:
        raise BadFile(path, None, "", f"{size} bytes; at most {limit} are read")
    return content


def _read(path: Path, limit: int) -> str:
    content = read_bytes(path, limit)
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise BadFile(path, None, "", "UTF-16 text; save it as UTF-8")
    if (known := describe_bytes(content)) is not None:
        raise BadFile(path, None, "", known)
    try:
        text = content.decode("utf-8-sig")  # without the byte-order mark that some editors write
    except UnicodeDecodeError as error:
        raise BadFile(path, None, "", f"not UTF-8 text (byte {error.start}); save it as UTF-8") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _last_line_of(text: str, piece: str) -> int | None:
    at = text.rfind(piece)
    return None if at < 0 else text.count("\n", 0, at) + 1


