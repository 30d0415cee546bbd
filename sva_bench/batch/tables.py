"""The tables of a batch as CSV, for spreadsheets; its rows are in the shards."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from sva_bench.analysis.over_maps import BatchSummary
from sva_bench.batch.folder import write


def write_tables(folder: Path, summary: BatchSummary) -> None:
    """Write ``maps.csv``, map by map, and ``aggregate.csv``, over maps.

    Raises:
        BadInput: If they cannot be written.
    """
    maps = [[row.world, row.variant, row.scenario, row.seeds, row.vss.mean, *_ends(row.vss.ci95), row.vss_pct]
            for row in summary.maps]
    over = [[row.variant, row.scenario, row.maps, row.vss.mean, *_ends(row.vss.ci95), row.vss_pct.mean,
             *_ends(row.vss_pct.ci95)] for row in summary.aggregate]
    _write(folder / "maps.csv", ("world", "variant", "scenario", "seeds", "vss", "vss_low", "vss_high", "vss_pct"),
           maps)
    _write(folder / "aggregate.csv", ("variant", "scenario", "maps", "vss", "vss_low", "vss_high", "vss_pct",
                                      "vss_pct_low", "vss_pct_high"), over)


def _ends(interval: tuple[float, float] | None) -> tuple[float | None, float | None]:
    return interval or (None, None)


def _write(path: Path, header: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(header)
    table.writerows(rows)
    write(path, text.getvalue().encode())
