"""YAML and JSON files in, checked data out: every complaint names file, line and key.

The only importer of ruamel.yaml. Aliases, duplicate keys and oversized files are refused at the door:
no document of ours needs them, and an alias bomb can fill any memory.
"""

from __future__ import annotations

import copy
import json
import math
import os
import stat
from collections.abc import Callable, Mapping
from io import StringIO
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.composer import Composer
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from sva_bench.errors import BadFile, nearest
from sva_bench.files.complaints import Loc as Loc
from sva_bench.files.complaints import first_complaint, shown
from sva_bench.files.json_lines import json_line
from sva_bench.files.mistaken import what_it_is, what_the_text_is

MAX_YAML_BYTES = 4_000_000  # a world of thousands of obstacles stays below 1 MB
MAX_JSON_BYTES = 200_000_000  # 2000 sites, written with ten digits, stay below 100 MB
MAX_DEPTH = 32
MAX_YAML_VALUES = 200_000  # keys and values; a world of 10 000 obstacles has 120 000, which take 5 s to read

NAME = r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$"
"""Pattern of names of worlds, sites, robots and scenarios."""

Name = Annotated[str, StringConstraints(pattern=NAME)]
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0)]
Bounded = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=1e9)]
"""Times [s] and incentives: sums of more than 1e9 would lose the feasibility tolerance to rounding."""
Probability = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=1)]
WholeNumber = Annotated[int, Field(strict=True, ge=0)]


class Section(BaseModel):
    """A part of a document: frozen, and an unknown key is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True)


SectionT = TypeVar("SectionT", bound=BaseModel)


class Document:
    """Plain data read from a file, which knows the line of each key."""

    def __init__(self, path: Path, data: Any, text: str, root: Node | None = None) -> None:
        self.path, self.data, self.text = path, data, text
        self._root = root

    def error(self, loc: Loc, problem: str) -> BadFile:
        """A complaint about the value at ``loc``, e.g. ``("sites", "pois", "p1")``."""
        return BadFile(self.path, self.line(loc), dotted(loc), problem)

    def line(self, loc: Loc) -> int | None:
        """Line of the key at ``loc``, counted from 1; of the nearest parent where it is absent."""
        if self._root is None:
            return json_line(self.text, loc)
        node: Node = self._root
        line = node.start_mark.line
        for part in loc:
            if isinstance(node, MappingNode):
                found = next(((k, v) for k, v in node.value if k.value == str(part)), None)
                if found is None:
                    break
                line, node = found[0].start_mark.line, found[1]
            elif isinstance(node, SequenceNode) and isinstance(part, int) and part < len(node.value):
                node = node.value[part]
                line = node.start_mark.line
            else:
                break
        return int(line) + 1

    def written(self, loc: Loc) -> str | None:
        """How a YAML file writes the scalar at ``loc``; ``None`` where none stands there."""
        node = self._root
        for part in loc:
            if isinstance(node, MappingNode):
                node = next((v for k, v in node.value if k.value == str(part)), None)
            elif isinstance(node, SequenceNode) and isinstance(part, int) and part < len(node.value):
                node = node.value[part]
            else:
                return None
        return str(node.value)[:60] if isinstance(node, ScalarNode) and node.value else None

    def changed(self, key: str, value: Any, named: Mapping[Loc, str] | None = None) -> Document:
        """The same with another value at a dotted key, e.g. ``robots.uv2.fuel_capacity_s``; lines stay those read.

        Names may hold dots themselves: the longest name that is there counts.

        Args:
            key: The key; sections on the way that aren't there are made.
            value: The value.
            named: Sections that are not made, since their keys are names that the file gives: what they are names of.
        """
        data = copy.deepcopy(self.data)
        at, words = data, key.split(".")
        loc: Loc = ()
        while True:
            name, words = _next_name(at, words)
            if isinstance(at, list) and not (isinstance(name, int) and name < len(at)):
                raise self.error((), f"{key}: there is a list of {len(at)} items at {name!r}; count them from 0")
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


def _next_name(at: Any, words: list[str]) -> tuple[Any, list[str]]:
    """The next step of a dotted key, and what is left of it."""
    if isinstance(at, list):
        return int(words[0]) if words[0].isdecimal() else words[0], words[1:]
    for count in range(len(words), 0, -1):
        name = ".".join(words[:count])
        if isinstance(at, dict) and name in at:
            return name, words[count:]
    return words[0], words[1:]


def dotted(loc: Loc) -> str:
    """``("map", "obstacles", 2)`` as ``map.obstacles[2]``."""
    text = ""
    for part in loc:
        word = part if isinstance(part, int) or (part.isprintable() and len(part) <= 64) else shown(part)
        text += f"[{word}]" if isinstance(part, int) else f".{word}" if text else str(word)
    return text


def read_yaml(path: Path) -> Document:
    """Read a YAML 1.2 file without aliases, tags or duplicate keys.

    Raises:
        BadFile: If it cannot be read, is too large, or is not plain YAML.
    """
    return parse_yaml(_read(path, MAX_YAML_BYTES), path)


def parse_yaml(text: str, path: Path) -> Document:
    """What the text of such a file says, read from ``path`` or about to be written there.

    Raises:
        BadFile: If it is not plain YAML.
    """
    try:
        root = _compose(text)
    except YAMLError as error:
        if (known := what_the_text_is(text)) is not None:
            raise BadFile(path, None, "", known) from None
        if not isinstance(error, MarkedYAMLError):
            raise BadFile(path, None, "", f"not valid YAML: {str(error).splitlines()[0]}") from None
        mark = error.problem_mark or error.context_mark
        raise BadFile(path, mark.line + 1 if mark else None, "", f"not valid YAML: {error.problem}") from None
    except RecursionError:
        raise BadFile(path, None, "", f"nested deeper than {MAX_DEPTH} levels") from None
    except (ValueError, OverflowError):
        raise BadFile(path, None, "", "not valid YAML: an escape that is no character") from None
    if root is None:
        raise BadFile(path, 1, "", "the file is empty")
    return Document(path, _plain(root, path, ()), text, root)


def read_json(path: Path, most: int = MAX_JSON_BYTES) -> Document:
    """Read a JSON file of so many bytes at most; NaN, infinities and duplicate keys are refused.

    Raises:
        BadFile: If it cannot be read, is too large, or is not JSON.
    """
    text = _read(path, most)

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) < len(pairs):
            keys = [key for key, _ in pairs]
            key = next(key for key in keys if keys.count(key) > 1)
            raise BadFile(path, _last_line_of(text, f'"{key}"'), dotted((key,)), "this key stands twice; remove one")
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
        if path.suffix.lower() in (".yaml", ".yml", ".map"):
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


def validate(document: Document, schema: type[SectionT], kind: str) -> SectionT:
    """Check a document against a schema.

    Args:
        document: What was read.
        schema: A pydantic model.
        kind: The format that the file must declare, e.g. ``sva-bench/world@1``.

    Raises:
        BadFile: For the first complaint, with file, line, key and what to change.
    """
    check_kind(document, kind)
    try:
        return schema.model_validate(document.data)
    except ValidationError as error:
        raise document.error(*first_complaint(document.data, schema, error, document.written)) from None


def check_kind(document: Document, kind: str) -> None:
    """Refuse a document that is not a mapping of the declared kind."""
    if not isinstance(document.data, dict):
        raise document.error((), f"expected a mapping that starts with 'format: {kind}'")
    found, known = document.data.get("format"), what_it_is(document.data)
    if found is None:
        raise document.error((), known or f"the key 'format' is missing; add 'format: {kind}'")
    if found != kind:
        other = isinstance(found, str) and found.partition("@")[0] != kind.partition("@")[0]
        hint = f"; {known}" if other and known is not None else ""
        raise document.error(("format",), f"expected {kind!r}, found {shown(found)}{hint}")


def read_bytes(path: Path, limit: int) -> bytes:
    """The bytes of a regular file, of at most so many; pipes and devices are refused unopened.

    Raises:
        BadFile: If it is no such file.
    """
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise BadFile(path, None, "", "not a file")
        # Whatever has become of it since then: no waiting for a writer, and never more than asked for.
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
    try:
        text = content.decode("utf-8-sig")  # a byte-order mark, as editors write it, is no part of the text
    except UnicodeDecodeError as error:
        raise BadFile(path, None, "", f"not UTF-8 text (byte {error.start})") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _last_line_of(text: str, piece: str) -> int | None:
    at = text.rfind(piece)
    return None if at < 0 else text.count("\n", 0, at) + 1


class _StrictComposer(Composer):
    """Composes nodes, refusing aliases before they are followed."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        from ruamel.yaml.events import AliasEvent

        self.values: int = getattr(self, "values", 0) + 1
        if self.values > MAX_YAML_VALUES:
            raise MarkedYAMLError(problem=f"more than {MAX_YAML_VALUES} keys and values; at most so many are read",
                                  problem_mark=self.parser.peek_event().start_mark)
        if self.parser.check_event(AliasEvent):
            event = self.parser.peek_event()
            raise MarkedYAMLError(problem="aliases are not allowed; write the value out", problem_mark=event.start_mark)
        return super().compose_node(parent, index)


def _compose(text: str) -> Node | None:
    yaml = YAML(typ="safe", pure=True)
    yaml.Composer = _StrictComposer
    node: Node | None = yaml.compose(text)
    return node


def _plain(node: Node, path: Path, loc: Loc) -> Any:
    """Python data of a node tree: mappings, lists and plain scalars only."""
    line = node.start_mark.line + 1
    if len(loc) > MAX_DEPTH:
        raise BadFile(path, line, dotted(loc[:3]), f"nested deeper than {MAX_DEPTH} levels")
    if isinstance(node, MappingNode):
        data: dict[str, Any] = {}
        for key_node, value_node in node.value:
            if not isinstance(key_node, ScalarNode):
                raise BadFile(path, key_node.start_mark.line + 1, dotted(loc), "a key must be a plain word")
            key = str(key_node.value)
            if key in data:
                raise BadFile(path, key_node.start_mark.line + 1, dotted((*loc, key)),
                              "this key stands twice; remove one")
            data[key] = _plain(value_node, path, (*loc, key))
        return data
    if isinstance(node, SequenceNode):
        return [_plain(item, path, (*loc, number)) for number, item in enumerate(node.value)]
    return _scalar(node, path, loc)


def _scalar(node: Node, path: Path, loc: Loc) -> Any:
    """The value of a plain YAML 1.2 scalar; what looks like a date stays text."""
    text, kind = str(node.value), str(node.tag).rpartition(":")[2]
    if not str(node.tag).startswith("tag:yaml.org,2002:") or kind not in _SCALARS:
        raise BadFile(path, node.start_mark.line + 1, dotted(loc),
                      f"the tag {shown(str(node.tag))} is not allowed; write a plain value")
    try:
        value = _SCALARS[kind](text)
    except (ValueError, OverflowError):
        raise BadFile(path, node.start_mark.line + 1, dotted(loc), f"{shown(text)} is no valid {kind}") from None
    if isinstance(value, float) and not math.isfinite(value):
        raise BadFile(path, node.start_mark.line + 1, dotted(loc), f"expected a finite number, found {shown(text)}")
    return value


def _whole(text: str) -> int:
    if len(text) > 400:  # far beyond any float, and Python prints none of more than 4300 digits
        raise ValueError(text)
    return int(text, 0) if text[:2].lower() in ("0x", "0o") else int(text)


def _number(text: str) -> float:
    return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))


_SCALARS: dict[str, Callable[[str], Any]] = {
    "str": str,
    "timestamp": str,
    "null": lambda _: None,
    "bool": lambda text: text.lower() == "true",
    "int": _whole,
    "float": _number,
}


def pretty_json(data: Any, indent: int = 0, width: int = 116) -> str:
    """JSON that a person can read: what fits on a line stays on it."""
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


def pretty_yaml(data: Mapping[str, Any], remarks: Mapping[Loc, str], width: int = 116) -> str:
    """YAML that a person can read: what holds no mapping inside stands on one line.

    Args:
        data: The content.
        remarks: Comments by the key or list item that they stand above; ``()`` is the head of the file. One that
            begins with a newline has an empty line above it.
        width: Where long lines are broken.
    """
    yaml = YAML()
    yaml.width = width
    yaml.indent(mapping=2, sequence=4, offset=2)
    root = _commented(data, (), remarks)
    if () in remarks:
        root.yaml_set_start_comment(remarks[()])
    stream = StringIO()
    yaml.dump(root, stream)
    return "".join(line.rstrip() + "\n" for line in stream.getvalue().rstrip().splitlines())


def _commented(item: Any, loc: Loc, remarks: Mapping[Loc, str]) -> Any:
    if not isinstance(item, Mapping | list):
        return item
    named = isinstance(item, Mapping)
    pairs = [(key, _commented(value, (*loc, key), remarks))
             for key, value in (item.items() if isinstance(item, Mapping) else enumerate(item))]
    node = CommentedMap(pairs) if named else CommentedSeq(value for _, value in pairs)
    if not item or (loc and not any(_holds_mapping(value) for _, value in pairs)):
        node.fa.set_flow_style()
        return node
    node.fa.set_block_style()
    for key, _ in pairs:
        if (*loc, key) in remarks:
            node.yaml_set_comment_before_after_key(key, before=remarks[*loc, key], indent=2 * len(loc))
    return node


def _holds_mapping(item: Any) -> bool:
    return isinstance(item, Mapping) or (isinstance(item, list) and any(_holds_mapping(x) for x in item))


def _deep(item: Any) -> bool:
    """Whether an item of a list holds more than numbers and words."""
    return isinstance(item, dict) or (isinstance(item, list) and any(isinstance(x, dict | list) for x in item))
