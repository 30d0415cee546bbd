"""The values of a varied key compared: what is each worth more than a reference, map by map or trial by trial?"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from sva_bench.analysis.compared_values import (
    KeyComparison,
    ValueGain,
    ValueRow,
    other_settings,
    shown_value,
    variant_of,
)
from sva_bench.analysis.moments import Clusters, Figure, Moments, joined, pooled
from sva_bench.analysis.over_maps import UnitSummary
from sva_bench.analysis.results import Estimate
from sva_bench.analysis.scenarios import UnitScenario
from sva_bench.analysis.statistics import estimate
from sva_bench.arrays import FloatArray
from sva_bench.batch.folder import shard_path
from sva_bench.batch.grid import Grid, Point
from sva_bench.batch.map_samples import over_maps
from sva_bench.batch.shards import Note, read_note, unit_of
from sva_bench.batch.sweep import Sweep
from sva_bench.errors import BadInput, nearest
from sva_bench.storage.tables import SHARDS, pieces_of

_COMPARED = ("stochastic", "deterministic")
_MOST_HELD = 20_000_000
"""Values of trials kept in memory; further ones are read again."""


@dataclass(frozen=True, kw_only=True)
class Asked:
    """A comparison that is asked for: a varied key, and the value that others are compared with, as JSON."""

    key: str
    reference: str


def asked_by(sweep: Sweep, grid: Grid) -> tuple[Asked, ...]:
    """The comparisons that a sweep asks for, by its options or in its file.

    Raises:
        BadFile: If one of the file is wrong, as for ``asked_of``.
        BadInput: If one of the options is.
    """
    if sweep.file is None or "compare" in sweep.from_options:
        return asked_of(sweep.compare, grid)
    try:
        return asked_of(sweep.compare, grid, "")
    except BadInput as error:
        raise sweep.file.error(("compare",), str(error)) from None


def asked_of(words: Sequence[str], grid: Grid, what: str = "--compare ") -> tuple[Asked, ...]:
    """The comparisons of options such as ``robots.uv2.fuel_capacity_s=300``.

    Without a reference it is the value that the world files have, if it is among those of the key, else the first.

    Args:
        words: Keys, each with its reference if that is said.
        grid: What is run.
        what: What messages begin with.

    Raises:
        BadInput: If a key is not varied in the grid or is asked for twice, or has no such value.
    """
    varied = values_of(grid)
    if words and not varied and any(point.variant for point in grid.points):
        raise BadInput(f"--compare {words[0]}: the manifest of this batch, of an older version, doesn't say the varied "
                       "settings one by one; run the batch again")
    found: list[Asked] = []
    for word in words:
        key = next((name for name in varied if word == name or word.startswith(f"{name}=")), None)
        if key is None:
            name = word.partition("=")[0]
            raise BadInput(f"{what}{word}: " + (
                f"{name} is not varied in this batch; {nearest(name, list(varied))}" if varied else
                f"nothing is varied in this batch; give values by {_given(what)} KEY=V1,V2"))
        values = varied[key]
        if len(values) < 2:
            raise BadInput(f"{what}{word}: {key} has one value only, {shown_value(values[0])}; give others by "
                           f"{_given(what)} {key}=V1,V2")
        if any(other.key == key for other in found):
            raise BadInput(f"{what}{key}: asked for twice; give it once")
        told = word[len(key) + 1:] if len(word) > len(key) else None
        usual = grid.own.get(key, '"x1"' if '"x1"' in values else values[0])
        reference = usual if told is None else _among(values, told)
        if reference is None:
            raise BadInput(f"{what}{word}: {key} has no such value in this batch; take one of "
                           f"{', '.join(map(shown_value, values))}")
        found.append(Asked(key=key, reference=reference))
    return tuple(found)


def _given(what: str) -> str:
    """How values are given where comparisons are asked for: by an option, or in a file."""
    return "--set" if what else "set:"


def _among(values: Sequence[str], told: str) -> str | None:
    """The value that is meant, written as in ``--set`` or as a number of equal size."""
    for value in values:
        if told.strip() in (value, shown_value(value)):
            return value
    for value in values:
        try:
            if float(told) == float(value):
                return value
        except ValueError:
            continue
    return None


def values_of(grid: Grid) -> dict[str, tuple[str, ...]]:
    """The varied keys of a grid, each with its values."""
    found: dict[str, dict[str, None]] = {}
    for point in grid.points:
        for key, value in point.settings.items():
            found.setdefault(key, {})[value] = None
    return {key: tuple(values) for key, values in found.items()}


def compared(
    asked: Sequence[Asked], grid: Grid, folder: Path, done: frozenset[str] | set[str], units: Sequence[UnitSummary],
) -> tuple[KeyComparison, ...]:
    """The comparisons that are asked for.

    Args:
        asked: What is asked for.
        grid, folder, done: The batch, its folder, and the names of its completed units.
        units: Their summaries.
    """
    return tuple(_compared(each, grid, folder, done, units) for each in asked)


def _compared(
    asked: Asked, grid: Grid, folder: Path, done: frozenset[str] | set[str], units: Sequence[UnitSummary]
) -> KeyComparison:
    values = values_of(grid)[asked.key]
    maps, settings = {point.world.name for point in grid.points}, {p.variant: p.settings for p in grid.points}
    several = len(maps) > 1
    found: dict[tuple[str, str], dict[str, _Place]] = {}
    for unit in units:
        for scenario in unit.scenarios:
            mine = settings[unit.variant]
            value, others = mine[asked.key], variant_of(other_settings(mine, asked.key))
            place = found.setdefault((scenario.name, others), {}).setdefault(value, _Place(unit.variant, {}))
            place.results.setdefault(unit.world, []).append(scenario)
    of_scenario: dict[str, int] = {}
    for (name, _), places in found.items():
        if asked.reference in places:
            of_scenario[name] = of_scenario.get(name, 0) + len(places) - 1
    rows = []
    trials = _Trials(grid, folder, done)
    # Map by map, so that few shards are in memory at a time.
    gains = {(world, name, others, value): trials.gains(
        name, world, place.variant, places[asked.reference].variant, max(of_scenario.get(name, 1), 1))
        for world in dict.fromkeys(unit.world for unit in units)
        for (name, others), places in found.items() if world in places.get(asked.reference, _NOWHERE).results
        for value, place in places.items() if value != asked.reference and world in place.results}
    for (name, others), places in found.items():
        for value in (value for value in values if value in places):
            place, pairs = places[value], max(of_scenario.get(name, 1), 1)
            on_maps = [met for world in place.results if (met := gains.get((world, name, others, value), ()))]
            executed, vss = (place.over_maps(_value), place.over_maps(_vss)) if several else trials.at(
                name, next(iter(place.results)), place.variant)
            gain, vss_gain = (_gain([met[number] for met in on_maps], pairs, several=several) if on_maps else None
                              for number in (0, 1))
            rows.append(ValueRow(scenario=name, others=others, value=value, executed=executed, vss=vss, gain=gain,
                                 vss_gain=vss_gain, maps=len(place.results)))
    return KeyComparison(key=asked.key, reference=asked.reference, values=values, rows=tuple(rows),
                         sample="maps" if several else "trials")


def _value(scenario: UnitScenario) -> Estimate:
    return scenario.stochastic.executed


def _vss(scenario: UnitScenario) -> Estimate:
    return scenario.vss.executed


@dataclass(frozen=True)
class _Place:
    """One variant under one scenario: its results by map, seed by seed."""

    variant: str
    results: dict[str, list[UnitScenario]]

    def over_maps(self, read: Callable[[UnitScenario], Estimate]) -> Estimate:
        """The mean over maps, of each map's mean over its seeds."""
        return over_maps([[read(seed) for seed in seeds] for seeds in self.results.values()], sure=all(
            p >= 1 for seeds in self.results.values() for found in seeds for p in found.availability.values()))


_NOWHERE = _Place("", {})


@dataclass(frozen=True, kw_only=True)
class _MapGain:
    """A difference on one map over its trials: with an interval of its own, and one that holds with others."""

    single: Estimate
    adjusted: Estimate


def _gain(maps: Sequence[_MapGain], pairs: int, *, several: bool) -> ValueGain:
    """The difference over maps, or that on the only map that there is."""
    single, adjusted = maps[0].single, maps[0].adjusted
    if several:
        single = over_maps([[each.single] for each in maps], sure=False)
        adjusted = over_maps([[each.adjusted] for each in maps], sure=False, comparisons=pairs)
    return ValueGain(mean=single.mean, ci95=single.ci95, ci95_adjusted=adjusted.ci95,
                     distinguishable=adjusted.excludes_zero)


class _Trials:
    """Figures of maps and variants, from the shards of their trials."""

    def __init__(self, grid: Grid, folder: Path, done: frozenset[str] | set[str]) -> None:
        self._grid, self._folder, self._done = grid, folder, done
        self._points = {(point.world.name, point.variant): point for point in grid.points}
        held = 2 * max(grid.unit_trials, 1) * max(len(point.world.scenarios) for point in grid.points)
        self._note = lru_cache(maxsize=1000)(self._read_note)
        self._totals = lru_cache(maxsize=max(2, _MOST_HELD // held))(self._read_totals)

    def at(self, scenario: str, world: str, variant: str) -> tuple[Estimate, Estimate]:
        """The executed value of the stochastic plan and the executed VSS of a variant on a map."""
        value, vss = self._over_ranges(self._points[world, variant], lambda note, *_: (
            note.tallies[scenario].plans["stochastic"].total, note.tallies[scenario].difference))
        return estimate(value), estimate(vss)

    def gains(self, scenario: str, world: str, variant: str, other: str, pairs: int) -> tuple[_MapGain, ...]:
        """How much more the two are in one variant than in another, trial by trial; none where no unit has both."""
        here, there = self._points[world, variant], self._points[world, other]

        def differences(note: Note, seed: int, first: int) -> tuple[Figure, Figure] | None:
            if self._grid.unit_name(there, seed, first) not in self._done:
                return None
            mine, its = note.tallies[scenario], self._note(world, other, seed, first).tallies[scenario]
            s, d = (self._totals(world, variant, seed, first)[scenario, plan]
                    - self._totals(world, other, seed, first)[scenario, plan] for plan in _COMPARED)
            return (less(mine.plans["stochastic"].total, its.plans["stochastic"].total, s),
                    less(mine.difference, its.difference, s - d))

        return tuple(_MapGain(single=estimate(figure), adjusted=estimate(figure, comparisons=pairs))
                     for figure in self._over_ranges(here, differences))

    def _over_ranges(self, point: Point, read: Callable[[Note, int, int], tuple[Figure, ...] | None]
                     ) -> tuple[Figure, ...]:
        """Figures of each range of trials, joined over ranges and pooled over seeds."""
        seeds = []
        for seed in self._grid.seeds:
            ranges = [found for first in self._ranges(point, seed) if (found := read(
                self._note(point.world.name, point.variant, seed, first), seed, first)) is not None]
            if ranges:
                seeds.append(_folded(joined, ranges))
        return _folded(pooled, seeds) if seeds else ()

    def _ranges(self, point: Point, seed: int) -> Iterator[int]:
        for first, _ in self._grid.ranges():
            if self._grid.unit_name(point, seed, first) in self._done:
                yield first

    def _read_note(self, world: str, variant: str, seed: int, first: int) -> Note:
        point = self._points[world, variant]
        unit = unit_of(self._grid, point, seed, first)
        return read_note(shard_path(self._folder, self._grid.unit_name(point, seed, first)), unit)

    def _read_totals(self, world: str, variant: str, seed: int, first: int) -> dict[tuple[str, str], FloatArray]:
        """Value of the team in each trial of a range, by scenario and plan.

        Raises:
            BadFile: If a shard is no table of ours, or cut off.
        """
        point, trials = self._points[world, variant], dict(self._grid.ranges())[first]
        found = {(scenario.name, plan): np.zeros(trials) for scenario in point.world.scenarios for plan in _COMPARED}
        path = shard_path(self._folder, self._grid.unit_name(point, seed, first))
        columns = pa.schema([SHARDS.field(name) for name in ("scenario", "planner", "trial", "value")])
        for piece in pieces_of(path, columns):
            scenarios, planners = (piece[name].combine_chunks() for name in ("scenario", "planner"))
            at, value = piece["trial"].to_numpy() - first, piece["value"].to_numpy()
            within = (at >= 0) & (at < trials)
            for (scenario, plan), total in found.items():
                rows = within & _equal(scenarios, scenario) & _equal(planners, plan)
                total += np.bincount(at[rows], weights=value[rows], minlength=trials)
        return found


def _equal(column: Any, word: str) -> np.ndarray[Any, np.dtype[np.bool_]]:
    codes, known = column.indices.to_numpy(), column.dictionary.to_pylist()
    return np.asarray(codes == known.index(word)) if word in known else np.zeros(len(codes), dtype=bool)


def _folded(join: Callable[[Figure, Figure], Figure], parts: Sequence[tuple[Figure, ...]]) -> tuple[Figure, ...]:
    found = parts[0]
    for part in parts[1:]:
        found = tuple(join(a, b) for a, b in zip(found, part, strict=True))
    return found


def less(a: Figure, b: Figure, differences: FloatArray) -> Figure:
    """The difference of two figures of the same trials under the same noise draws.

    How failures make it vary is taken from the differences as executed, since rows don't tell what each trial lost to
    noise; that noise makes them vary too counts twice, which only makes the interval wider.

    Args:
        a, b: The figures.
        differences: The first less the second in each trial, shape (trials,).
    """
    draws = max(len(a.taken.counts), len(b.taken.counts))
    sums = [np.pad(part.taken.sums, (0, draws - len(part.taken.sums))) for part in (a, b)]
    counts = a.taken.counts if len(a.taken.counts) == draws else b.taken.counts
    return Figure(
        drawn=Moments(count=a.drawn.count, mean=a.drawn.mean - b.drawn.mean,
                      squares=float(np.sum((differences - differences.mean()) ** 2))),
        drawn_bounds=_between(a.drawn_bounds, b.drawn_bounds), taken_bounds=_between(a.taken_bounds, b.taken_bounds),
        taken=Clusters(counts=counts, sums=sums[0] - sums[1]),
        certain=None if a.certain is None or b.certain is None else _between(a.certain, b.certain))


def _between(a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float]:
    return a[0] - b[1], a[1] - b[0]
