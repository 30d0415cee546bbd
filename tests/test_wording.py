"""Messages and pages count in plain English: one station, two stations."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from sva_bench.files.printable import counted
from tests.test_architecture import MODULES, PACKAGE

DOCS = PACKAGE.parent / "docs"
NOUNS = ("stations|pois|points of interest|robots|trials|scenarios|units|worlds|draws|noise draws|"
         "rows|entries|maps|seeds|plans|pairs|legs|stops|routes|vehicles|sets|items|cells|sites|travel times|rollouts|"
         "missions|files|attempts|numbers|outcomes|bytes|variants|keys|values|days|hours|levels|boxes|columns|lines")


def naive_plurals(path: Path) -> Iterator[tuple[int, str]]:
    """Line and noun wherever a number that isn't a constant has a plural behind it, which would be wrong of one."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        for value, behind in zip(node.values, node.values[1:], strict=False) if isinstance(node, ast.JoinedStr) else ():
            if not (isinstance(value, ast.FormattedValue) and isinstance(behind, ast.Constant)):
                continue
            constant = isinstance(value.value, ast.Name) and value.value.id.isupper()
            found = re.match(rf" ({NOUNS})\b", str(behind.value), re.IGNORECASE)
            if found and not constant:
                yield value.lineno, f"{ast.unparse(value.value)} {found[1]}"


@pytest.mark.parametrize("module", MODULES)
def test_what_is_counted_is_plural_only_where_it_is_not_one(module: str) -> None:
    found = list(naive_plurals(PACKAGE / module))
    assert {noun for _, noun in found} <= NEVER_ONE, found


NEVER_ONE = {  # said of what is more than a bound, or two at least
    "fewest maps", "summary.rollouts noise draws", "len(content) bytes", "points worlds", "units units",
    "rows outcomes", "size bytes", "len(sets) sets", "len(items) entries", "longest entries", "len(routes) routes",
    "len(route) stops", "most files", "head.num_rows rows", "largest bytes", "pois POIs", "rows cells",
    "robots robots", "least POIs", "slowest.pois POIs", "listed(study.pois) POIs",
    "method plans", "other robots", "other vehicles",  # a verb; names of failure processes
}


def test_singular_and_plural_are_distinguished() -> None:
    assert [counted(count, "entry", "entries") for count in (0, 1, 2)] == ["0 entries", "1 entry", "2 entries"]
    assert [counted(count, "map") for count in (0, 1, 2)] == ["0 maps", "1 map", "2 maps"]


IDLE = "waits or stops at a POI, each second burns `idle_share` of a second of driving (default 0"


@pytest.mark.parametrize("page", ["noise", "contact", "calibration", "formats", "model"])
def test_pages_say_one_rule_of_what_standing_burns(page: str) -> None:
    text = " ".join((DOCS / f"{page}.md").read_text(encoding="utf-8").split())
    assert IDLE in text
    assert not re.search(r"\bwait\w*\b[^.]* (no|without) fuel", text, re.IGNORECASE)
