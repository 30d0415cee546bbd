"""``docs/api.md``, made of the docstrings: ``python -m tests.reference > docs/api.md`` writes it again."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import sva_bench as sb

ROOT = Path(__file__).parents[1]
FUNCTIONS = ("load_world", "travel_times", "fuel_costs", "make_instance", "plan", "certify", "execute", "run", "record")
TYPES = ("World", "TravelTimes", "FuelCosts", "Instance", "Plan", "Certificate", "Result", "Summary",
         "ComparisonSummary")
ERRORS = ("SvaBenchError", "BadInput", "BadFile", "UnknownName", "UnreachableSite", "NeverArrives",
          "NoRoomForBerths", "NoRoomForSlots", "InfeasiblePlan", "WorkerLost")

HEAD = """\
# From Python

`import sva_bench as sb` gives the stages of the commands as functions: the same names for the same options, the same
defaults, and the same figures to the bit. Paths are words or `Path`; worlds, instances and plans may be given as the
paths of their files. Nothing is written unless a place is named, and no function prints: `progress=print` says how far
it is. Warnings, such as of a narrow passage or of a plan driven though it is infeasible, go to the logger `sva_bench`,
which Python shows on standard error until a program sets up `logging`. What is wrong with an input is one of the
[errors](#errors), each an `sb.SvaBenchError` that says what to change, an argument of a wrong type is a `ValueError`,
Ctrl-C is `KeyboardInterrupt`. Workers need no guard of a script's main module.

```python
{example}```

In a notebook (`examples/mission_value.ipynb` is one) plans, certificates, summaries and results show themselves as
tables. `result.outcomes` and `result.legs` are Arrow tables with the columns of `outcomes.parquet` and `legs.parquet`
([files](formats.md)); `.to_pandas()` makes data frames of them where pandas is installed.

This page is made of the docstrings (`python -m tests.reference`).
"""


def reference() -> str:
    """The page."""
    example = (ROOT / "examples" / "from_world_to_vss.py").read_text(encoding="utf-8")
    parts = [HEAD.format(example=example), "## Functions\n"]
    for name in FUNCTIONS:
        function = getattr(sb, name)
        parts.append(f"### `sb.{name}`\n\n```python\n{_signature(name, function)}\n```\n\n{_told(function)}")
    parts.append("## What they take and give\n")
    for name in TYPES:
        kind = getattr(sb, name)
        members = [f"- `.{member}{'()' if inspect.isfunction(value) else ''}`: {_first_line(value)}"
                   for member, value in _members(kind).items()
                   if not member.startswith("_") and (inspect.isfunction(value) or isinstance(value, property))]
        parts.append(f"### `sb.{name}`\n\n{_told(kind)}" + ("\n" + "\n".join(members) + "\n" if members else ""))
    parts.append("## Errors\n\nAll can be caught by these names, or together as `sb.SvaBenchError`:\n")
    parts += [f"- `sb.{name}`{_kinds(getattr(sb, name))}: {_first_line(getattr(sb, name))}" for name in ERRORS]
    return "\n".join(parts) + "\n"


def _members(kind: type) -> dict[str, object]:
    """What a class and those that it extends hold, the outermost first."""
    return {name: value for of in reversed(kind.__mro__) for name, value in vars(of).items()}


def _kinds(error: type) -> str:
    """What else an error is."""
    told = [f"`sb.{of.__name__}`" if of.__module__.startswith("sva_bench") else f"`{of.__name__}`"
            for of in error.__bases__ if of.__name__ not in ("SvaBenchError", "Exception")]
    return f" (a {' and a '.join(told)})" if told else ""


def _signature(name: str, function: object) -> str:
    assert callable(function)
    lines = []
    for parameter in inspect.signature(function).parameters.values():
        if parameter.kind is parameter.KEYWORD_ONLY and "    *," not in lines:
            lines.append("    *,")
        default = "" if parameter.default is parameter.empty else f" = {parameter.default!r}"
        lines.append(f"    {parameter.name}{default},")
    return "\n".join([f"sb.{name}(", *lines, ")"])


def _told(thing: object) -> str:
    """A docstring as Markdown: its sections are headings, their entries lists."""
    text = (inspect.getdoc(thing) or "").replace("``", "`")
    lines, entries = [], False
    for line in text.splitlines():
        if re.fullmatch(r"(Args|Attributes|Raises|Returns|Source):", line):
            entries = line[:-1] in ("Args", "Attributes", "Raises")
            lines += [f"**{line[:-1]}**", ""]
        elif line.startswith("    ") and not line.startswith("     "):
            names, colon, rest = line.strip().partition(": ")
            lines.append(f"- `{names}`: {rest}" if entries and colon else line.strip())
        else:
            lines.append("  " + line.strip() if line.startswith("     ") and entries else line.strip())
    return "\n".join(lines).strip() + "\n"


def _first_line(member: object) -> str:
    return (inspect.getdoc(member) or "").replace("``", "`").splitlines()[0]


if __name__ == "__main__":
    import sys

    sys.stdout.write(reference())
