"""Messages for validation errors of pydantic: which key of the file, and what to change."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Any, get_type_hints

from pydantic import BaseModel, ValidationError

from sva_bench.errors import closest, nearest
from sva_bench.files.printable import counted, shown

Loc = tuple[str | int, ...]


def first_complaint(
    data: Any, schema: type[Any], error: ValidationError, written: Callable[[Loc], str | None] | None = None,
) -> tuple[Loc, str]:
    """Location of the first problem in a document, and what to change there.

    Args:
        data: The document's data.
        schema: The dataclass or pydantic model that it was validated against.
        error: The validation error.
        written: The text of the scalar at a location of a YAML file; ``None`` for JSON.
    """
    # An unknown key first: it usually explains a missing one beside it.
    details = sorted(_most_likely(data, error.errors()), key=lambda d: d["type"] not in _UNKNOWN)
    detail = details[0]
    loc = _existing(data, detail["loc"])
    if detail["type"] in _UNKNOWN:
        key = str(detail["loc"][-1])
        known = _keys_at(schema, detail["loc"][:-1])
        if key in known:  # a key of another alternative of the union
            return loc, f"the key {shown(key)} doesn't go with the other keys here; remove one or the other"
        if key.isdecimal() and detail["input"] is None:  # {size_m: 0,5} has a key 5
            return loc, f"unknown key {shown(key)}; if it is what follows a decimal comma, write a decimal point"
        return loc, f"unknown key {shown(key)}; {nearest(key, known)}"
    if detail["type"] == "missing":
        return loc, f"the key {detail['loc'][-1]!r} is missing; add it"
    if detail["type"] == "string_pattern_mismatch":
        name = shown(detail["input"])
        return loc, f"{name} is no valid name; use up to 64 letters, digits, '_', '.', '-', the first a letter or digit"
    told = _told_at(schema, detail["loc"])
    message = _in_plain_words(detail) if told is None or detail["type"] not in _OF_LISTS else f"expected {told}"
    found = detail["input"]
    text = (written(loc) if written else None) or (None if found is None else str(found).lower())
    if detail["type"] == "string_type" and not isinstance(found, dict | list) and text is not None and len(text) <= 60:
        if written is None:
            kind = f"the number {text}" if not isinstance(found, bool) else text
            return loc, f'expected a word, found {kind}; if it is a name, write "{text}"'
        kind = "nothing" if found is None else "a truth value" if isinstance(found, bool) else "a number"
        return loc, f"expected a word, and {text} without quotes is {kind}; if it is a name, write '{text}'"
    also = f", found {shown(found)}" if not isinstance(found, dict | list) and detail["type"] != "value_error" else ""
    if isinstance(found, str) and detail["type"] in ("float_type", "int_type"):
        also = f", found the text {shown(found)}" + (
            ": take the quotes away" if _numeric(found) else _comma(found) or _of_per_cent(found, loc))
    if detail["type"] in _BOUNDED_ABOVE:
        also += _as_a_share(detail, str(loc[-1]) if loc else "")
    if detail["type"] in ("too_short", "too_long") and told is not None:
        also = f", found {counted(detail['ctx']['actual_length'], 'entry', 'entries')}"
    if detail["type"] == "literal_error" and isinstance(found, str):
        close = closest(found.lower(), re.findall("'([^']*)'", detail["ctx"]["expected"]))
        also += f"; did you mean {close!r}?" if close is not None else ""
    if detail["type"] == "too_long" and written and all(isinstance(item, int) for item in found):
        also += "; if commas among them are decimal ones, write decimal points"
    return loc, message[:1].lower() + message[1:] + also


def of_an_option(error: ValidationError) -> str:
    """The message for the value of an option, with the value."""
    detail = error.errors()[0]
    message = _in_plain_words(detail)
    found = str(detail["input"])
    if detail["type"] == "value_error":  # ours or typer's, which say the value
        return message
    share = _as_a_share(detail, "") if detail["type"] in _BOUNDED_ABOVE else _of_per_cent(found, ())
    return f"{message}, found {found if found.isalnum() else shown(found)}{_comma(found)}{share}"


def of_a_choice(message: str) -> str:
    """The message for an option that takes one of several words, with the nearest one."""
    told = re.search(r"'([^']*)' is not one of ('[^']*'(?:, '[^']*')*)", message)
    close = None if told is None else closest(told[1].lower(), re.findall("'([^']*)'", told[2]))
    return message if close is None else f"{message.removesuffix('.')}; did you mean {close!r}?"


def _in_plain_words(detail: Any) -> str:
    kind = detail["type"]
    if kind in ("too_short", "too_long"):
        least, most = detail["ctx"].get("min_length"), detail["ctx"].get("max_length")
        bound = f"least {counted(least, 'entry', 'entries')}" if kind == "too_short" else \
            f"most {counted(most, 'entry', 'entries')}"
        return f"expected at {bound}, found {detail['ctx']['actual_length']}"
    if kind in _PLAIN_WORDS:
        return _PLAIN_WORDS[kind].format(**detail.get("ctx", {}))
    message_text: str = detail["msg"]
    return message_text.removeprefix("Value error, ")


def _as_a_share(detail: Any, key: str) -> str:
    """The hint for a share that was given in per cent; empty for what is none."""
    found, most = detail["input"], min(detail["ctx"].get(bound, math.inf) for bound in ("le", "lt"))
    number = float(found) if isinstance(found, int | float) or _numeric(str(found)) else math.nan
    if most > 1 or not 1 < number <= 100 or number / 100 > most or key.endswith(_UNITS):
        return ""
    return f": a share, not per cent; did you mean {number / 100:g}?"


def _of_per_cent(text: str, loc: Loc) -> str:
    """The hint for a share that was given with a sign of per cent; empty for other text."""
    number = text.strip().removesuffix("%").strip()
    if not text.strip().endswith("%") or not _numeric(number) or (loc and str(loc[-1]).endswith(_UNITS)):
        return ""
    return f": write a share, {float(number) / 100:g}"


def hint_of_per_cent(text: str) -> str:
    """The hint for per cent that were given without their sign, or as a share; empty for other text."""
    number = float(text) if _numeric(text) else 0.0
    return f"; did you mean {number if number >= 1 else 100 * number:g}%?" if number > 0 else ""


def _comma(text: str) -> str:
    """The hint for a number with a decimal comma; empty for other text."""
    return f": write a decimal point, {text.replace(',', '.')}" if text.count(",") == 1 and len(text) <= 40 \
        and _numeric(text.replace(",", ".")) else ""


def _numeric(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


_UNITS = ("_m", "_s", "_kg", "_deg", "_pct")
"""Ends of keys that are no shares."""
_BOUNDED_ABOVE = ("less_than_equal", "less_than")
_OF_LISTS = ("too_short", "too_long", "list_type", "tuple_type")
"""Pydantic's error types of lists of so many entries."""
_UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")
"""Pydantic's error types for an unknown key: of models, and of dataclasses."""

_PLAIN_WORDS = {  # messages by pydantic's error types
    "dict_type": "expected a mapping", "model_type": "expected a mapping",
    "dataclass_type": "expected a mapping", "tuple_type": "expected a list", "list_type": "expected a list",
    "less_than_equal": "expected at most {le}", "greater_than_equal": "expected at least {ge}",
    "less_than": "expected less than {lt}", "greater_than": "expected more than {gt}",
    "string_type": "expected a word", "float_type": "expected a number", "int_type": "expected an integer",
    "float_parsing": "expected a number", "int_parsing": "expected an integer",
    "int_from_float": "expected an integer",
}


def _most_likely(data: Any, details: list[Any]) -> list[Any]:
    """The errors of the alternative of a union that was most likely intended.

    An invalid box fails as a cylinder and as a wall too; only the errors of the box are useful.
    """
    place, depth = _prefix_in_data(data, details[0]["loc"])
    if depth == len(details[0]["loc"]):
        return details
    tags: dict[str | int, list[Any]] = {}
    for detail in details:
        if _prefix_in_data(data, detail["loc"]) == (place, depth) and len(detail["loc"]) > depth:
            tags.setdefault(detail["loc"][depth], []).append(detail)

    def implausibility(tag: str | int) -> tuple[int, bool]:
        score = 0
        for detail in tags[tag]:
            whole = len(detail["loc"]) == depth + 1  # the error is about the whole value
            holds = isinstance(detail["input"], dict | list)
            other = detail["type"].endswith("_type") or (detail["type"] == "literal_error" and holds)
            score += 100 if whole and other else 0
            score += 3 if holds and other else 0  # a list where a number belongs
            score += detail["type"] in (*_UNKNOWN, "missing")
        return score, str(tag).startswith("dict[")

    return tags[min(tags, key=implausibility)] if len(tags) > 1 else details


def _prefix_in_data(data: Any, loc: Loc) -> tuple[Loc, int]:
    """The longest prefix of a location that exists in the data; next is an alternative's name, or a missing key."""
    for depth, part in enumerate(loc):
        inside = part in data if isinstance(data, dict) else (
            isinstance(data, list) and isinstance(part, int) and part < len(data))
        if not inside:
            return loc[:depth], depth
        data = data[part]
    return loc, len(loc)


def _existing(data: Any, loc: Loc) -> Loc:
    """``loc`` without the parts that pydantic adds for unions and keys of mappings."""
    kept: list[str | int] = []
    for number, part in enumerate(loc):
        if isinstance(data, dict) and part in data:
            kept.append(part)
            data = data[part]
        elif isinstance(data, dict) and number == len(loc) - 1 and part not in ("[key]",) and "[" not in str(part):
            kept.append(part)  # a missing key: shown, located at its parent
        elif isinstance(data, list) and isinstance(part, int) and part < len(data):
            kept.append(part)
            data = data[part]
    return tuple(kept)


def _keys_at(schema: type[Any], loc: Loc) -> list[str]:
    """The schema's keys at ``loc``, of every alternative of a union."""
    return sorted({key for form in _forms_at(schema, loc) for key in _keys_of(form)})


def _forms_at(schema: type[Any], loc: Loc) -> set[type[Any]]:
    """The sections at ``loc``, every alternative of a union."""
    found: set[type[Any]] = {schema}
    for part in loc:
        inner: set[type[Any]] = set()
        for form in found:
            inner |= _forms_in(_keys_of(form).get(str(part)))
        found = inner or found
    return found


def _told_at(schema: type[Any], loc: Loc) -> str | None:
    """What the schema says of a key, of any alternative of a union; ``None`` where that is nothing."""
    for depth in range(len(loc) - 1, -1, -1):
        if isinstance(loc[depth], str):
            break
    else:
        return None
    if depth < len(loc) - 1:  # of an item
        return None
    described = [form.model_fields[str(loc[depth])].description for form in _forms_at(schema, loc[:depth])
                 if issubclass(form, BaseModel) and str(loc[depth]) in form.model_fields]
    return next((told for told in described if told), None)


def _keys_of(form: type[Any]) -> dict[str, Any]:
    """The keys of a dataclass or model, and the type of each."""
    if issubclass(form, BaseModel):
        return {field.alias or name: field.annotation for name, field in form.model_fields.items()}
    hints = get_type_hints(form)
    return {field.name: hints[field.name] for field in fields(form)}


def _forms_in(annotation: Any) -> set[type[Any]]:
    if isinstance(annotation, type) and (issubclass(annotation, BaseModel) or is_dataclass(annotation)):
        return {annotation}
    forms: set[type[Any]] = set()
    for argument in getattr(annotation, "__args__", ()):
        forms |= _forms_in(argument)
    return forms


def dotted(loc: Loc) -> str:
    """``("map", "obstacles", 2)`` as ``map.obstacles[2]``."""
    text = ""
    for part in loc:
        word = part if isinstance(part, int) or (part.isprintable() and len(part) <= 64) else shown(part)
        text += f"[{word}]" if isinstance(part, int) else f".{word}" if text else str(word)
    return text
