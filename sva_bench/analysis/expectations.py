"""What a summary is expected to say, as expressions: ``S3.vss.executed_pct >= 5``."""

from __future__ import annotations

import json
import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sva_bench.analysis.over_maps import labelled
from sva_bench.errors import BadInput, nearest

_COMPARED: dict[str, Callable[[Any, Any], bool]] = {
    ">=": operator.ge, "<=": operator.le, "==": operator.eq, "!=": operator.ne, ">": operator.gt, "<": operator.lt}
_OPERATOR = re.compile(r'"[^"]*"|(>=|<=|==|!=|>|<)')
_STEP = re.compile(r'\[\s*("(?P<quoted>[^"]*)"|(?P<index>\d+))\s*\]|(?P<word>[^.\["\]\s]+)')
_EQUAL = 1e-9  # relative: figures that are summed in another order are the same
_LONGEST = 2000
EXAMPLE = '"S3.vss.executed_pct >= 5"'

Step = str | int
Value = float | str | bool | None


@dataclass(frozen=True, kw_only=True)
class Judged:
    """An expectation, and what the summary says.

    Attributes:
        expression: As it was given.
        met: Whether it holds.
        found: The value on the left.
        wanted: The value on the right.
        about: The interval of the value, where the summary has one, in words.
    """

    expression: str
    met: bool
    found: Value
    wanted: Value
    about: str = ""

    def said(self) -> str:
        """The value that was found, with its interval, and what it is compared with if that isn't written there."""
        right = "" if self.expression.endswith(_shown(self.wanted)) else f", compared with {_shown(self.wanted)}"
        return f"{self.expression}: found {_shown(self.found)}{self.about}{right}"

    def as_dict(self) -> dict[str, Any]:
        """The content of ``--json``."""
        return {"expression": self.expression, "met": self.met, "found": self.found, "wanted": self.wanted}


def judge(expression: str, summary: Mapping[str, Any]) -> Judged:
    """Whether a summary says what is expected.

    Args:
        expression: ``PATH OPERATOR VALUE``. A path begins with a scenario's name (in a batch with its variant, as
            tables show it) or a key of the summary; ``[0]`` counts the items of a list from 0, ``["S.3"]`` is a name
            with dots or spaces. A value is a number, ``true``, ``false``, ``null``, a word, or another path.
        summary: The content of ``summary.json``, of a run or a batch.

    Raises:
        BadInput: If it is no such expression, or names what isn't there or can't be compared.
    """
    if len(expression) > _LONGEST:
        raise BadInput(f"an expression of {len(expression)} characters; at most {_LONGEST} are read")
    signs = [match for match in _OPERATOR.finditer(expression) if match.group(1)]
    left, right = (expression[:signs[0].start()].strip(), expression[signs[0].end():].strip()) if signs else ("", "")
    if len(signs) != 1 or not left or not right:
        raise BadInput(f"{expression}: expected PATH OPERATOR VALUE, such as {EXAMPLE}; operators are "
                       f"{', '.join(_COMPARED)}")
    found, about = _figure(expression, left, summary)
    wanted = _wanted(expression, right, summary)
    return Judged(expression=expression, met=_compare(expression, found, signs[0].group(1), wanted), found=found,
                  wanted=wanted, about=about)


def _compare(expression: str, found: Value, sign: str, wanted: Value) -> bool:
    numbers = _is_number(found) and _is_number(wanted)
    if sign in ("==", "!="):
        assert isinstance(found, float | int | str | None)
        same = math.isclose(float(found), float(wanted), rel_tol=_EQUAL, abs_tol=_EQUAL) \
            if numbers and found is not None and wanted is not None else found == wanted and \
            isinstance(found, bool) == isinstance(wanted, bool)
        return same == (sign == "==")
    if not _is_number(wanted) or not (numbers or found is None):
        raise BadInput(f"{expression}: {sign} compares numbers, and here are {_shown(found)} and {_shown(wanted)}; use "
                       "== or !=")
    return numbers and _COMPARED[sign](found, wanted)  # what the run has no figure of is not met


def _is_number(value: Value) -> bool:
    return isinstance(value, float | int) and not isinstance(value, bool)


def _wanted(expression: str, text: str, summary: Mapping[str, Any]) -> Value:
    """The value on the right."""
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        if "." in text or "[" in text:
            return _figure(expression, text, summary)[0]
        return text
    if isinstance(value, dict | list) or (isinstance(value, float) and not math.isfinite(value)):
        raise BadInput(f"{expression}: expected a number, true, false, null, a word or a path on the right, found "
                       f"{text}")
    read: Value = value
    return read


def _figure(expression: str, path: str, summary: Mapping[str, Any]) -> tuple[Value, str]:
    """The value at a path, and its interval in words."""
    steps = _steps(expression, path)
    scenarios = {str(scenario["name"]): scenario for scenario in summary.get("scenarios", ())}
    over_maps = {labelled(row["scenario"], row["variant"]): row for row in summary.get("aggregate", ())}
    at: Any = {**summary, **scenarios, **over_maps}
    parent: Any = at
    walked = ""
    key: Step = ""
    while steps:
        parent, key = at, steps[0]
        at, key, steps = _next(expression, at, steps, walked)
        walked += f"[{key}]" if isinstance(key, int) else f".{key}" if walked else key
    if isinstance(at, dict | list):
        inside = ", ".join(list(at)[:8]) if isinstance(at, dict) else f"items 0 to {len(at) - 1}, as in {walked}[0]"
        raise BadInput(f"{expression}: {walked} is no single value; name one in it: {inside or 'it is empty'}")
    return at, _interval(parent, key)


def _steps(expression: str, path: str) -> list[Step]:
    """The names and numbers of a path."""
    steps: list[Step] = []
    at = 0
    while at < len(path):
        at += path[at] == "." and bool(steps)
        match = _STEP.match(path, at)
        if match is None:
            raise BadInput(f"{expression}: can't read {path[at:at + 20]!r} in {path!r}; a path is names with dots "
                           'between them, [0] for an item of a list, ["S.3"] for a name that holds dots')
        index, quoted, word = match.group("index"), match.group("quoted"), match.group("word")
        steps.append(int(index) if index is not None else quoted if word is None else word)
        at = match.end()
    return steps


def _next(expression: str, at: Any, steps: Sequence[Step], walked: str) -> tuple[Any, Step, list[Step]]:
    """What the next step leads to; names may hold dots, and the longest that is there is taken."""
    where = f" in {walked}" if walked else ""
    if isinstance(at, list):
        if not isinstance(steps[0], int) or steps[0] >= len(at):
            raise BadInput(f"{expression}: {walked} is a list of {len(at)}; count its items from 0, as in {walked}[0]")
        return at[steps[0]], steps[0], list(steps[1:])
    if not isinstance(at, dict):
        raise BadInput(f"{expression}: there is nothing{where} to name; it is {_shown(at)}")
    for count in range(len(steps), 0, -1):
        name = ".".join(str(step) for step in steps[:count])
        if name in at and not any(isinstance(step, int) for step in steps[:count]):
            return at[name], name, list(steps[count:])
    raise BadInput(f"{expression}: there is no {str(steps[0])!r}{where}; {nearest(str(steps[0]), list(at))}")


def _interval(parent: Any, key: Step) -> str:
    """The interval of a figure, where there is one beside it."""
    if not isinstance(parent, dict) or not isinstance(key, str):
        return ""
    if key in ("mean", "share") and parent.get("ci95"):
        return " " + _ends(parent["ci95"])
    whole = parent.get(key.removesuffix("_pct"))
    if key.endswith("_pct") and isinstance(whole, dict) and whole.get("ci95"):
        return f" ({key.removesuffix('_pct')} {_shown(whole.get('mean'))} {_ends(whole['ci95'])})"
    return ""


def _ends(interval: Sequence[float | None]) -> str:
    return f"[{', '.join(_shown(end) for end in interval)}]"


def _shown(value: Value) -> str:
    """A value as it is written in expressions."""
    return f"{value:.6g}" if isinstance(value, float) else value if isinstance(value, str) else json.dumps(value)
