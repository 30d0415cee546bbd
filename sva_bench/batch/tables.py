"""The tables of a batch as CSV, for spreadsheets; its rows are in the shards."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Protocol, TypeVar

from sva_bench.analysis.calibration_table import CALIBRATION_COLUMNS, calibration_rows
from sva_bench.analysis.over_maps import BatchSummary
from sva_bench.batch.folder import write
from sva_bench.batch.reactions_over_maps import vss_of

GainT = TypeVar("GainT")
Gain_co = TypeVar("Gain_co", covariant=True)


class _Reaction(Protocol[Gain_co]):
    """Figures of a reaction, of one map and seed or over maps."""

    @property
    def value_of_recourse(self) -> Mapping[str, Gain_co]:
        """What reacting adds to each plan."""

    @property
    def vss_with_recourse(self) -> Gain_co:
        """The best plan for the policy less the deterministic one."""

    @property
    def anticipation(self) -> Gain_co:
        """The best plan for the policy less the stochastic one."""


def write_tables(folder: Path, summary: BatchSummary) -> None:
    """Write ``maps.csv``, map by map, and ``aggregate.csv``, over maps; the same of reactions, and ``calibration.csv``,
    where there are any.

    Raises:
        BadInput: If they cannot be written.
    """
    maps = [[row.world, row.variant, row.scenario, row.seeds, row.vss.mean, *_ends(row.vss.ci95), row.vss_pct]
            for row in summary.maps]
    over = [[row.variant, row.scenario, row.maps, row.vss.mean, *_ends(row.vss.ci95), row.vss_pct.mean,
             *_ends(row.vss_pct.ci95)] for row in summary.aggregate]
    curves = [[unit.world, unit.variant, unit.seed, *row] for unit in summary.units
              for row in calibration_rows(unit.scenarios)]
    if curves:
        _write(folder / "calibration.csv", ("world", "variant", "seed", *CALIBRATION_COLUMNS), curves)
    if summary.reactions:
        _write(folder / "reactions.csv", (*_REACTION, "maps", *_GAIN, "pct_low", "pct_high"), _over_maps(summary))
        _write(folder / "reactions-maps.csv", ("world", "seed", *_REACTION, *_GAIN), _map_by_map(summary))
    _write(folder / "maps.csv", ("world", "variant", "scenario", "seeds", "vss", "vss_low", "vss_high", "vss_pct"),
           maps)
    _write(folder / "aggregate.csv", ("variant", "scenario", "maps", "vss", "vss_low", "vss_high", "vss_pct",
                                      "vss_pct_low", "vss_pct_high"), over)


_REACTION = ("variant", "scenario", "policy", "news", "figure", "plan")
_GAIN = ("mean", "low", "high", "pct")


def _over_maps(summary: BatchSummary) -> list[list[object]]:
    """A row for each reaction and figure over maps; ``plan`` is that of a value of recourse."""
    return [[row.variant, row.scenario, row.policy, row.news, figure, plan, row.maps, gain.mean, *_ends(gain.ci95),
             gain.pct.mean, *_ends(gain.pct.ci95)]
            for row in summary.reactions
            for figure, plan, gain in _figures(row.vss, row)]


def _map_by_map(summary: BatchSummary) -> list[list[object]]:
    """A row for each map, seed, reaction and figure."""
    return [[unit.world, unit.seed, unit.variant, scenario.name, row.policy, row.news, figure, plan, gain.mean,
             *_ends(gain.ci95), gain.pct]
            for unit in summary.units for scenario in unit.scenarios for row in scenario.reactions or ()
            for figure, plan, gain in _figures(vss_of(row), row)]


def _figures(vss: GainT, row: _Reaction[GainT]) -> Iterator[tuple[str, str, GainT]]:
    """Name, plan and value of each figure of a reaction."""
    yield "vss", "", vss
    for plan, gain in row.value_of_recourse.items():
        yield "value_of_recourse", plan, gain
    yield "vss_with_recourse", "", row.vss_with_recourse
    yield "anticipation", "", row.anticipation


def _ends(interval: tuple[float, float] | None) -> tuple[float | None, float | None]:
    return interval or (None, None)


def _write(path: Path, header: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(header)
    table.writerows(rows)
    write(path, text.getvalue().encode())
