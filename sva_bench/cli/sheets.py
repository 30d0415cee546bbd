"""Tables on the terminal that fit its width without a cut word: by stacking, by headings above rows, by leaving out."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from rich.cells import cell_len
from rich.console import Console
from rich.text import Text

from sva_bench.files.printable import printable

_GAP = "  "
_LEAST = 13
"""Letters of a remark in a column of figures before it goes on in a second line: ``not distinguishable`` has 19."""


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column of a table.

    Attributes:
        heading: What stands above it.
        words: Whether it holds names, from the left; figures are from the right.
        last: The greater, the sooner it is left out where there is no room; 0 = never.
        above: Whether its name may stand in a line of its own above its rows; those before it then do too.
    """

    heading: str
    words: bool = False
    last: int = 0
    above: bool = False


@dataclass(frozen=True, kw_only=True)
class Sheet:
    """A table.

    Attributes:
        title: What it shows.
        columns: Its columns.
        rows: Its cells, row by row; empty ones in columns of words repeat what is above them.
        ends: Numbers of the rows behind which a line is left free.
    """

    title: str
    columns: Sequence[Column]
    rows: Sequence[Sequence[str]]
    ends: frozenset[int] = frozenset()


_NOUGHT = re.compile(r"(?<![\w.])-(0(?:\.0+)?)(?![\w.])")
"""A figure that was rounded to nought from below; names have letters about it."""
_NAME = 20
"""Letters of a name that may stand beside figures even where others are left out for it."""


def print_sheet(sheet: Sheet, console: Console, *, wide: bool = False, apart: bool = False) -> None:
    """Print a table within the console's width, and the columns that had to be left out.

    Args:
        sheet: The table.
        console: Where to.
        wide: As wide as it comes, whatever the console's width.
        apart: Whether a line is left free above it, for it follows text; below it there always is one.
    """
    plain = replace(sheet, rows=[[_NOUGHT.sub(r"\1", printable(cell)) for cell in row] for row in sheet.rows],
                    columns=[replace(column, heading=printable(column.heading)) for column in sheet.columns])
    laid_out, left_out = fitted(plain, 10**6 if wide else console.width)
    if not sheet.rows:
        return
    if apart:
        console.print()
    if sheet.title:
        console.print(Text(sheet.title, style="italic"), highlight=False, soft_wrap=wide)
    for line, is_head in laid_out:
        console.print(Text(line, style="bold" if is_head else ""), highlight=False, soft_wrap=True)
    if left_out:
        console.print(Text(f"Left out for want of room: {', '.join(left_out)}; --wide shows all.", style="italic"),
                      highlight=False)
    console.print()


def fitted(sheet: Sheet, width: int) -> tuple[list[tuple[str, bool]], list[str]]:
    """The lines of a table within a width, each with whether it is a heading; and the columns left out.

    Rows that are as wide as they come; then with headings in several lines; then with intervals below their figures;
    then with names above their rows; then without the columns that can best be spared; then without names beside rows.
    """
    levels = [k + 1 for k, column in enumerate(sheet.columns) if column.above]
    long = [level for level in levels[1:] if max((cell_len(row[level - 1]) for row in sheet.rows), default=0) > _NAME]
    empty = {k for k, column in enumerate(sheet.columns) if column.last and not any(row[k] for row in sheet.rows)}
    spare = sorted({column.last for column in sheet.columns if column.last}, reverse=True)
    kept, left_out = sheet, list[str]()
    tried = [(0, _as_is, _as_is), (0, _broken, _as_is), (0, _broken, _stacked)]
    for above in (*levels[:1], *long):
        tried += [(above, _broken, _as_is), (above, _broken, _stacked)]
    for without in (0, *([10**6] if empty else []), *spare):  # what holds nothing is spared first
        if without:
            left_out = [column.heading.replace("\n", " ") for k, column in enumerate(sheet.columns)
                        if column.last >= without and k not in empty]
            shown = [k for k, column in enumerate(sheet.columns) if column.last < without and k not in empty]
            kept = replace(sheet, columns=[sheet.columns[k] for k in shown],
                           rows=[[row[k] for k in shown] for row in sheet.rows])
        for above, heads, cells in tried:
            lines = _lines(kept, above, heads, cells, width)
            if _widest(lines) <= width:
                return lines, left_out
    for above in levels[1:]:
        lines = _lines(kept, above, _broken, _stacked, width)
        if _widest(lines) <= width:
            break
    return lines, left_out


_Break = Callable[[str, int], list[str]]


def _as_is(cell: str, _: int) -> list[str]:
    return cell.splitlines() or [""]


def _broken(cell: str, room: int) -> list[str]:
    """A heading in lines as wide as what is below it."""
    held = [re.sub(r"\[[^]]*\]", lambda found: found[0].replace(" ", "\u00a0"), part) for part in cell.splitlines()]
    return [line.replace("\u00a0", " ") for part in held for line in _wrapped(part, room)] or [""]


def _stacked(cell: str, room: int) -> list[str]:
    """A figure, and below it its interval or remark; a remark in lines as wide as the figures."""
    parts = re.split(r" (?=[\[(])", cell) if re.match(r"[-+\d.]", cell) else [cell]
    return [line for part in parts for each in part.splitlines() or [""]
            for line in ([each] if each.startswith("[") else _wrapped(each, room))]


def _wrapped(text: str, room: int) -> list[str]:
    return textwrap.wrap(text, max(room, 1), break_long_words=False, break_on_hyphens=False) or [""]


def _lines(sheet: Sheet, above: int, heads: _Break, cells: _Break, width: int) -> list[tuple[str, bool]]:
    columns = sheet.columns[above:]
    rows = [[cells(cell, _room(sheet, above + k, cells)) if not column.words else _as_is(cell, 0)
             for k, (column, cell) in enumerate(zip(columns, row[above:], strict=True))] for row in sheet.rows]
    body = [max((cell_len(line) for row in rows for line in row[k]), default=0) for k in range(len(columns))]
    head = [heads(column.heading, room) for column, room in zip(columns, body, strict=True)]
    widths = [max(room, *(cell_len(line) for line in lines)) for room, lines in zip(body, head, strict=True)]
    indent = _GAP * bool(above)
    tall = max((len(lines) for lines in head), default=0)
    found = [(indent + line, True) for line in _joined(
        [[""] * (tall - len(lines)) + lines for lines in head], columns, widths)]
    found.append((indent + _GAP.join("─" * room for room in widths), True))
    before = ""
    for number, row in enumerate(rows):
        label = ", ".join(cell for cell in sheet.rows[number][:above] if cell)
        if label and label != before:
            before = label
            found += [(line, True) for line in textwrap.wrap(label, width, subsequent_indent=_GAP,
                                                             break_long_words=False, break_on_hyphens=False)]
        found += [(indent + line, False) for line in _joined(row, columns, widths)]
        if number in sheet.ends and number < len(rows) - 1:
            found.append(("", False))
    return found


def _room(sheet: Sheet, column: int, cells: _Break) -> int:
    """How wide the figures of a column are: remarks among them are broken to that."""
    if cells is _as_is:
        return 0
    parts = [part for row in sheet.rows if re.match(r"[-+\d.]", row[column])
             for part in re.split(r" (?=[\[(])", row[column])]
    return max((cell_len(part) for part in parts), default=_LEAST)


def _joined(cells: Sequence[Sequence[str]], columns: Sequence[Column], widths: Sequence[int]) -> Iterator[str]:
    """The lines of a row, whose cells may have several."""
    for k in range(max((len(cell) for cell in cells), default=0)):
        parts = []
        for cell, column, room in zip(cells, columns, widths, strict=True):
            text = cell[k] if k < len(cell) else ""
            free = " " * (room - cell_len(text))
            parts.append(text + free if column.words else free + text)
        yield _GAP.join(parts).rstrip()


def _widest(lines: Sequence[tuple[str, bool]]) -> int:
    return max((cell_len(line) for line, _ in lines), default=0)
