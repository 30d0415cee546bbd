"""The tables of a batch as CSV, for spreadsheets; its rows are in the shards."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from sva_bench.batch.folder import write


def write_tables(folder: Path, summary: Mapping[str, Any]) -> None:
    """Write ``maps.csv``, map by map, and ``aggregate.csv``, over maps.

    Args:
        folder: The batch folder.
        summary: The content of its ``summary.json``.

    Raises:
        BadInput: If they cannot be written.
    """
    maps = [[row["world"], row["variant"], row["scenario"], row["seeds"], *_interval(row["vss"]), row["vss_pct"]]
            for row in summary["maps"]]
    over = [[row["variant"], row["scenario"], row["maps"], *_interval(row["vss"]), *_interval(row["vss_pct"])]
            for row in summary["aggregate"]]
    _write(folder / "maps.csv", ("world", "variant", "scenario", "seeds", "vss", "vss_low", "vss_high", "vss_pct"),
           maps)
    _write(folder / "aggregate.csv", ("variant", "scenario", "maps", "vss", "vss_low", "vss_high", "vss_pct",
                                      "vss_pct_low", "vss_pct_high"), over)


def _interval(value: Mapping[str, Any]) -> tuple[float | None, float | None, float | None]:
    low, high = value["ci95"] or (None, None)
    return value["mean"], low, high


def _write(path: Path, header: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(header)
    table.writerows(rows)
    write(path, text.getvalue().encode())
