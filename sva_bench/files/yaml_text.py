"""YAML text to plain data and back. The only importer of ruamel.yaml."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from io import StringIO
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.composer import Composer
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, ScalarNode, SequenceNode
from ruamel.yaml.nodes import Node as Node

from sva_bench.errors import BadFile
from sva_bench.files.complaints import Loc as Loc
from sva_bench.files.complaints import dotted
from sva_bench.files.mistaken import describe_text, describe_yaml_error
from sva_bench.files.printable import shown

MAX_DEPTH = 32
MAX_YAML_VALUES = 200_000  # keys and values; a world of 10 000 obstacles has 120 000, which take 5 s to read


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


def compose(text: str, path: Path) -> Node | None:
    """The node tree of a YAML text; ``None`` of an empty one.

    Raises:
        BadFile: If it is not plain YAML.
    """
    yaml = YAML(typ="safe", pure=True)
    yaml.Composer = _StrictComposer
    try:
        node: Node | None = yaml.compose(text)
    except YAMLError as error:
        if (known := describe_text(text)) is not None:
            raise BadFile(path, None, "", known) from None
        if not isinstance(error, MarkedYAMLError):
            raise BadFile(path, None, "", f"not valid YAML: {str(error).splitlines()[0]}; remove it") from None
        mark = error.problem_mark or error.context_mark
        problem = describe_yaml_error(text, mark.line if mark else 0, str(error.problem))
        raise BadFile(path, mark.line + 1 if mark else None, "", problem) from None
    except RecursionError:
        raise BadFile(path, None, "", f"nested deeper than {MAX_DEPTH} levels") from None
    except (ValueError, OverflowError):
        raise BadFile(path, None, "", "not valid YAML: an escape that is no character") from None
    return node


def plain_data(node: Node, path: Path, loc: Loc) -> Any:
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
                              "this key is a duplicate; remove one")
            data[key] = plain_data(value_node, path, (*loc, key))
        return data
    if isinstance(node, SequenceNode):
        return [plain_data(item, path, (*loc, number)) for number, item in enumerate(node.value)]
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


def _integer(text: str) -> int:
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
    "int": _integer,
    "float": _number,
}


def pretty_yaml(data: Mapping[str, Any], remarks: Mapping[Loc, str], width: int = 116) -> str:
    """Readable YAML: values without a mapping inside are on one line.

    Args:
        data: The content.
        remarks: Comments by the key or list item above which they are written; ``()`` is the head of the file. One that
            begins with a newline is preceded by an empty line.
        width: Width at which lines are broken.
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


def line_in(root: Node, loc: Loc) -> int:
    """Line of the key at ``loc``, counted from 1; of the nearest parent where it is absent."""
    node: Node = root
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


def written_in(root: Node, loc: Loc) -> str | None:
    """The text of the scalar at ``loc``; ``None`` if there is none."""
    node: Any = root
    for part in loc:
        if isinstance(node, MappingNode):
            node = next((v for k, v in node.value if k.value == str(part)), None)
        elif isinstance(node, SequenceNode) and isinstance(part, int) and part < len(node.value):
            node = node.value[part]
        else:
            return None
    return str(node.value)[:60] if isinstance(node, ScalarNode) and node.value else None
