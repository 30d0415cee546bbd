"""``docs/keys.md``, made of the schemas of world and sweep files: ``python -m tests.reference_keys > docs/keys.md``."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from sva_bench.batch.sweep import _SweepFile
from sva_bench.world.schema import WorldFile

HEAD = """\
# Keys of world and sweep files

Every key, what it may be, and its default, as the program checks them. What they mean stands in
[Files](formats.md#world-yaml), [Noise](noise.md#keys) and [Robots](robots.md). An unknown key is an error that suggests
the nearest one; one without a default may be left out unless it is required. `[]` is an item of a list, `<name>` a name
of your own: up to 64 letters, digits, `_`, `.` and `-`.

`sva-bench world schema` prints the schema of worlds as JSON, for editors that complete YAML.
"""
TAIL = """
This page is made of the schemas (`python -m tests.reference_keys`).
"""
NAMED = "<name>"
NULL = "`null`"


@dataclass(frozen=True)
class Key:
    """A row of the table."""

    path: str
    value: str
    default: str


def page() -> str:
    """The page."""
    return HEAD + _table("World files", WorldFile.model_json_schema()) + _table(
        "Sweep files", _SweepFile.model_json_schema()) + TAIL


def _table(title: str, schema: dict[str, Any]) -> str:
    rows = [f"| `{key.path}` | {key.value} | {key.default} |".replace("  |", " |") for key in _keys(schema)]
    return "\n".join(["", f"## {title}", "", "| key | value | default |", "| --- | --- | --- |", *rows, ""])


def _keys(schema: dict[str, Any]) -> Iterator[Key]:
    definitions = schema.get("$defs", {})
    yield from _within("", schema, definitions)


def _within(path: str, section: dict[str, Any], definitions: dict[str, Any]) -> Iterator[Key]:
    """The keys of a section, and of those below it."""
    for name, found in section.get("properties", {}).items():
        needed = name in section.get("required", ())
        yield from _key(f"{path}{name}", found, needed, definitions)
    for found in section.get("patternProperties", {}).values():
        yield from _key(f"{path}{NAMED}", found, None, definitions)
    for found in (section.get("additionalProperties"),):
        if isinstance(found, dict):
            yield from _key(f"{path}{NAMED}", found, None, definitions)


def _key(path: str, found: dict[str, Any], needed: bool | None, definitions: dict[str, Any]) -> Iterator[Key]:
    kinds = _kinds(found, definitions)
    plain = [word for kind in kinds if not _keeps_keys(kind) if (word := _value(kind, definitions)) != NULL]
    sections = [kind for kind in kinds if _keeps_keys(kind)]
    own_names = any(kind.get("patternProperties") for kind in sections)
    if plain or not own_names:
        words = sorted(plain, key=lambda word: word.startswith("a list"))
        words += [] if own_names or not sections else ["a section"]
        yield Key(path, " or ".join(dict.fromkeys(words)), "required" if needed else _default(found))
    yield from _alternatives(f"{path}.", sections, definitions)
    for kind in kinds:
        if kind.get("type") == "array":
            items = [item for item in _kinds(kind.get("items", {}), definitions) if _keeps_keys(item)]
            yield from _alternatives(f"{path}[].", items, definitions)


def _alternatives(path: str, kinds: list[dict[str, Any]], definitions: dict[str, Any]) -> Iterator[Key]:
    """The keys of sections of which one is to be chosen, each key once, with when it is required."""
    if len(kinds) == 1:
        yield from _within(path, kinds[0], definitions)
        return
    chosen_by = [next(iter(kind.get("required", ())), None) for kind in kinds]
    rows: dict[str, list[tuple[int, Key]]] = {}
    for number, kind in enumerate(kinds):
        for key in _within(path, kind, definitions):
            rows.setdefault(key.path, []).append((number, key))
    for name, found in rows.items():
        free = [chosen_by[number] for number, key in found if key.default != "required"]
        if not name.removeprefix(path).isidentifier():
            default = found[0][1].default
        elif len(found) == 1 and name in (f"{path}{by}" for by in chosen_by):
            default = "chooses this kind"
        elif free:
            without = " or ".join(f"`{by}`" for by in free)
            default = f"required without {without}" if len(free) < len(found) else found[0][1].default
        else:
            default = f"required with {' or '.join(f'`{chosen_by[number]}`' for number, _ in found)}"
        yield Key(name, found[-1][1].value, default)


def _kinds(found: dict[str, Any], definitions: dict[str, Any]) -> list[dict[str, Any]]:
    """The alternatives at a key."""
    found = _resolved(found, definitions)
    return [_resolved(kind, definitions) for kind in found.get("anyOf", found.get("oneOf", [found]))]


def _resolved(kind: dict[str, Any], definitions: dict[str, Any]) -> dict[str, Any]:
    target = str(kind.get("$ref", "")).removeprefix("#/$defs/")
    return {**definitions[target], **{key: kind[key] for key in kind if key != "$ref"}} if target else kind


def _keeps_keys(kind: dict[str, Any]) -> bool:
    return bool(kind.get("properties") or kind.get("patternProperties"))


def _value(kind: dict[str, Any], definitions: dict[str, Any]) -> str:
    """What may stand at a key, in words."""
    if "const" in kind:
        return f"`{kind['const']}`"
    if "enum" in kind:
        return ", ".join(f"`{word}`" for word in kind["enum"])
    if "anyOf" in kind or "oneOf" in kind:
        words = (_value(one, definitions) for one in _kinds(kind, definitions))
        return " or ".join(dict.fromkeys(word for word in words if word != NULL))
    if kind.get("type") == "array":
        return _list_of(kind, definitions)
    if kind.get("type") in ("number", "integer"):
        return _number(kind)
    return {"string": "a name" if "pattern" in kind else "text", "boolean": "`true` or `false`", "null": NULL,
            "object": "a section"}.get(str(kind.get("type")), "anything")


def _list_of(kind: dict[str, Any], definitions: dict[str, Any]) -> str:
    least, most = kind.get("minItems"), kind.get("maxItems")
    item = _resolved(kind.get("items", {}), definitions)
    if any(_keeps_keys(one) for one in _kinds(item, definitions)):
        return "a list of sections" + (f", {most} at most" if most else "")
    if item.get("type") == "array":
        return f"{least} points `[x, y]`"
    if least == most == 2 and item.get("minimum", -1) < 0:
        return "`[x, y]`"
    what = _value(item, definitions)
    return f"{least} {what.replace('a number', 'numbers')}" if least == most and least else f"a list of: {what}"


def _number(kind: dict[str, Any]) -> str:
    word = "an integer" if kind["type"] == "integer" else "a number"
    low, high = kind.get("minimum"), kind.get("maximum")
    above = kind.get("exclusiveMinimum")
    low = None if low is not None and low <= -1e5 else low
    high = None if high is not None and high >= 1e5 else high
    if above is not None and (low is None or low <= 1e-5):
        return f"{word} above {above:g}" + (f", up to {high:g}" if high is not None else "")
    if low is not None and high is not None:
        return f"{word} from {low:g} to {high:g}"
    return word + (f" of {low:g} or more" if low is not None else f" up to {high:g}" if high is not None else "")


def _default(found: dict[str, Any]) -> str:
    default = found.get("default")
    return "" if default is None else f"`{default if isinstance(default, str) else json.dumps(default)}`"


if __name__ == "__main__":
    import sys

    sys.stdout.write(page())
