"""The tables of a batch as CSV, for spreadsheets; its rows are in the shards."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np

from sva_bench.analysis.calibration_table import CALIBRATION_COLUMNS, calibration_rows
from sva_bench.analysis.compared_values import other_settings, shown_value, variant_of
from sva_bench.analysis.over_maps import BatchSummary
from sva_bench.analysis.results import Estimate
from sva_bench.batch.folder import write
from sva_bench.batch.map_samples import over_maps
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
    where there are any, and ``compared.csv`` where values of a key are.

    Raises:
        BadInput: If they cannot be written.
    """
    keys, means = _keys_of(summary), _means_of(summary)
    settings = summary.settings
    maps = [[row.world, row.variant, row.scenario, row.seeds, row.vss.mean, *_ends(row.vss.ci95), row.vss_pct,
             *_plain(means[row.variant, row.scenario][row.world]), *_values(settings.get(row.variant, {}), keys)]
            for row in summary.maps]
    over = [[row.variant, row.scenario, row.maps, row.vss.mean, *_ends(row.vss.ci95), row.vss_pct.mean,
             *_ends(row.vss_pct.ci95), *_over(means[row.variant, row.scenario].values()),
             *_values(settings.get(row.variant, {}), keys)] for row in summary.aggregate]
    curves = [[unit.world, unit.variant, unit.seed, *row] for unit in summary.units
              for row in calibration_rows(unit.scenarios)]
    if curves:
        _write(folder / "calibration.csv", ("world", "variant", "seed", *CALIBRATION_COLUMNS), curves)
    if summary.reactions:
        _write(folder / "reactions.csv", (*_REACTION, "maps", *_GAIN, "pct_low", "pct_high"), _over_maps(summary))
        _write(folder / "reactions-maps.csv", ("world", "seed", *_REACTION, *_GAIN), _map_by_map(summary))
    if summary.compared:
        _write(folder / "compared.csv", (*_COMPARED, *keys), _compared(summary, keys))
    _write(folder / "maps.csv", ("world", "variant", "scenario", "seeds", "vss", "vss_low", "vss_high", "vss_pct",
                                 "stochastic", "deterministic", *keys), maps)
    _write(folder / "aggregate.csv", (
        "variant", "scenario", "maps", "vss", "vss_low", "vss_high", "vss_pct", "vss_pct_low", "vss_pct_high",
        *(f"{plan}{end}" for plan in ("stochastic", "deterministic") for end in ("", "_low", "_high")), *keys), over)


def _keys_of(summary: BatchSummary) -> list[str]:
    """The varied keys, each of which is a column."""
    return list(dict.fromkeys(key for settings in summary.settings.values() for key in settings))


def _values(settings: Mapping[str, str], keys: Sequence[str]) -> list[str]:
    return [shown_value(settings[key]) if key in settings else "" for key in keys]


_Means = list[tuple[Estimate, Estimate]]
"""What the stochastic and the deterministic plan collected on a map, seed by seed."""


def _means_of(summary: BatchSummary) -> dict[tuple[str, str], dict[str, _Means]]:
    """What the two plans collected on each map, by variant and scenario."""
    found: dict[tuple[str, str], dict[str, _Means]] = {}
    for unit in summary.units:
        for scenario in unit.scenarios:
            found.setdefault((unit.variant, scenario.name), {}).setdefault(unit.world, []).append(
                (scenario.stochastic.executed, scenario.deterministic.executed))
    return found


def _plain(means: _Means) -> list[float]:
    """Each plan's mean over seeds."""
    return [float(np.mean([each.mean for each in plan])) for plan in zip(*means, strict=True)]


def _over(means: Iterable[_Means]) -> list[float | None]:
    """The mean over maps of what each plan collected, with its interval."""
    maps = [tuple(zip(*seeds, strict=True)) for seeds in means]
    return [cell for plan in zip(*maps, strict=True) for found in [over_maps(plan, sure=False)]
            for cell in (found.mean, *_ends(found.ci95))]


_COMPARED = ("key", "reference", "value", "scenario", "others", "over", "maps",
             *(f"{figure}{end}" for figure in ("executed", "vss") for end in ("", "_low", "_high")),
             *(f"{figure}{end}" for figure in ("gain", "vss_gain") for end in (
                 "", "_low", "_high", "_adjusted_low", "_adjusted_high")))


def _compared(summary: BatchSummary, keys: Sequence[str]) -> list[list[object]]:
    """A row for each scenario and value of each key that is compared."""
    rows: list[list[object]] = []
    for found in summary.compared:
        by_place = {(variant_of(other_settings(each, found.key)), each[found.key]): each
                    for each in summary.settings.values() if found.key in each}
        for row in found.rows:
            figures = [cell for figure in (row.executed, row.vss) for cell in (figure.mean, *_ends(figure.ci95))]
            gains = [cell for gain in (row.gain, row.vss_gain) for cell in ([None] * 5 if gain is None else [
                gain.mean, *_ends(gain.ci95), *_ends(gain.ci95_adjusted)])]
            rows.append([found.key, shown_value(found.reference), shown_value(row.value), row.scenario, row.others,
                         found.sample, row.maps, *figures, *gains,
                         *_values(by_place[row.others, row.value], keys)])
    return rows


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
