"""Routes as CSV files: columns ``robot, stop, site``, a row per stop."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from sva_bench.errors import BadFile
from sva_bench.files.atomic import reason_of
from sva_bench.files.printable import counted

COLUMNS = ("robot", "stop", "site")
CSV_SUFFIX = ".csv"


@dataclass(frozen=True, kw_only=True)
class Row:
    """A stop of a route, and the line that it stands on."""

    site: str
    line: int


def read_rows(path: Path, most_bytes: int) -> dict[str, list[Row]]:
    """The stops of each robot, in order.

    Commas or semicolons separate columns, which may stand in any order; rows may too, for stops are numbered.

    Raises:
        BadFile: If it can't be read, is too large, or is no such table.
    """
    rows = _rows(path, most_bytes)
    header = [name.strip() for name in next(rows, (0, []))[1]]
    if sorted(header) != sorted(COLUMNS):
        raise BadFile(path, 1, "", f"expected the columns {', '.join(COLUMNS)}, found "
                      f"{', '.join(header)[:200] or 'nothing'}")
    stops: dict[str, dict[int, Row]] = {}
    for line, cells in rows:
        if not cells:
            continue
        if len(cells) != len(COLUMNS):
            raise BadFile(path, line, "", f"expected robot, stop and site, found {counted(len(cells), 'column')}")
        cell = dict(zip(header, (text.strip() for text in cells), strict=True))
        number = cell["stop"]
        if not (number.isascii() and number.isdecimal() and len(number) < 10):
            raise BadFile(path, line, "stop", f"expected the number of a stop, such as 0, found {number[:40]!r}")
        mine = stops.setdefault(cell["robot"], {})
        if int(number) in mine:
            raise BadFile(path, line, "stop", f"{cell['robot'][:64]} has stop {int(number)} already, in line "
                          f"{mine[int(number)].line}")
        mine[int(number)] = Row(site=cell["site"], line=line)
    return {robot: [mine[number] for number in sorted(mine)] for robot, mine in stops.items()}


def _rows(path: Path, most_bytes: int) -> Iterator[tuple[int, list[str]]]:
    """Lines and their cells."""
    try:
        with path.open("rb") as file:
            data = file.read(most_bytes + 1)
    except OSError as error:
        raise BadFile(path, None, "", f"cannot be read ({reason_of(error)})") from None
    if len(data) > most_bytes:
        raise BadFile(path, None, "", f"larger than {counted(most_bytes, 'byte')}; no plan is")
    try:
        text = data.decode("utf-8-sig")  # spreadsheets write a mark in front
    except UnicodeDecodeError:
        raise BadFile(path, None, "", "not UTF-8; save it as CSV in UTF-8") from None
    separator = ";" if ";" in text.partition("\n")[0] else ","
    table = csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True)
    while True:
        line = table.line_num + 1
        try:
            cells = next(table)
        except StopIteration:
            return
        except csv.Error as error:
            raise BadFile(path, line, "", f"no table: {error}") from None
        yield line, cells


def routes_as_csv(routes: Mapping[str, Sequence[str]]) -> str:
    """Routes as the content of a CSV file; robots that stay home have no rows."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(COLUMNS)
    for robot, route in routes.items():
        table.writerows((robot, number, site) for number, site in enumerate(route))
    return text.getvalue()
