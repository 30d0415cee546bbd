"""The grid of a batch: worlds and their variants, seeds, and units of trials."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from sva_bench import __version__
from sva_bench.analysis.calibration import target_of, target_text
from sva_bench.batch.schema import BatchSettings, OptionsEntry, PointEntry
from sva_bench.choices import PathPlanner
from sva_bench.errors import BadInput
from sva_bench.files.digest import digest
from sva_bench.files.read_back import Part
from sva_bench.files.records import as_dict
from sva_bench.solver.two_stage import SolveLimits
from sva_bench.study.options import Options
from sva_bench.world.load import world_as_dict, world_of
from sva_bench.world.model import World

MOST_POINTS, MOST_UNITS = 10_000, 200_000
"""Most worlds with variants, which are kept in memory; most units, which are files of one folder."""


_HASH = 10  # hexadecimal digits, without collisions among ten thousand variants; six would have some


@dataclass(frozen=True, eq=False, kw_only=True)
class Point:
    """A world variant with a path planner.

    Attributes:
        world: The world, with its variations.
        planner: How its paths are planned.
        variant: The name of its varied settings, e.g. ``robots.uv2.fuel_capacity_s=200``; empty without a sweep.
        settings: The varied settings: keys, each with its value as JSON; that of a planner is its bare name.
    """

    world: World
    planner: PathPlanner
    variant: str = ""
    settings: Mapping[str, str] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Its name in file names: the world's name, and a hash of the variant."""
        return f"{self.world.name}-{digest(self.variant)[:_HASH]}" if self.variant else self.world.name

    @property
    def label(self) -> str:
        """Its name as shown to users."""
        return f"{self.world.name} ({self.variant})" if self.variant else self.world.name

    def entry(self) -> PointEntry:
        """Its entry in the manifest."""
        return PointEntry(variant=self.variant, planner=self.planner, world=world_as_dict(self.world),
                          files=self.world.digests() or None, settings=dict(self.settings))


@dataclass(frozen=True, eq=False, kw_only=True)
class Grid:
    """Every point with every seed, with trials divided into units.

    Attributes:
        points: Worlds and variants.
        seeds: Seeds of failures and noise.
        options: Options of all runs, without seed and planner.
        unit_trials: Most trials of a unit.
        own: Of varied keys, the value that the world files have themselves, as JSON, where it is among theirs.
    """

    points: Sequence[Point]
    seeds: Sequence[int]
    options: Options
    unit_trials: int
    own: Mapping[str, str] = field(default_factory=dict)

    def settings(self) -> BatchSettings:
        """Everything that the rows and shards of a batch depend on."""
        stored = self.options
        options = OptionsEntry(
            trials=stored.trials, rollouts=stored.rollouts, fidelity=stored.fidelity, informed=False, assumptions=False,
            time_limit_s=stored.limits.time_limit_s, gap=stored.limits.gap, evpi=stored.evpi,
            policies=stored.policies, news=stored.news, anticipate=stored.anticipate or None,
            calibrate=None if stored.calibrate is None else target_text(stored.calibrate))
        return BatchSettings(version=__version__, seeds=tuple(self.seeds), options=options,
                             unit_trials=self.unit_trials, points={point.name: point.entry() for point in self.points},
                             own=dict(self.own))

    def map_files(self) -> dict[str, bytes]:
        """The files that worlds name, by their names within the batch folder; equal ones once."""
        return {f"{_map_folder(point.world.digests())}/{file.name}": file.content
                for point in self.points for file in point.world.files}

    def strands(self) -> Iterator[tuple[Point, int]]:
        """Every point with every seed."""
        for point in self.points:
            for seed in self.seeds:
                yield point, seed

    def ranges(self) -> list[tuple[int, int]]:
        """First trial and number of trials of each unit of a point and seed."""
        trials = self.options.trials
        return [(first, min(self.unit_trials, trials - first)) for first in range(0, trials, self.unit_trials)]

    def unit_name(self, point: Point, seed: int, first: int) -> str:
        """Part of a shard's file name."""
        name = f"{point.name}-seed{seed}"
        return name if self.options.trials <= self.unit_trials else f"{name}-t{first:08d}"

    def units(self) -> list[str]:
        """Names of all units, in order."""
        ranges = self.ranges()
        return [self.unit_name(point, seed, first) for point, seed in self.strands() for first, _ in ranges]


def checked(grid: Grid) -> Grid:
    """The grid, if the names of its points are unique and its size is within the limits.

    Raises:
        BadInput: If not.
    """
    known: dict[str, Point] = {}
    for point in grid.points:
        other = known.setdefault(point.name, point)
        if other is not point:
            raise BadInput(f"{other.label} and {point.label} would both be named {point.name!r} in the batch folder; "
                           "names must differ within a batch")
    refuse_too_many(len(grid.points), len(grid.seeds), grid.options.trials, grid.unit_trials)
    return grid


def refuse_too_many(points: int, seeds: int, trials: int, unit_trials: int) -> None:
    """Refuse a grid beyond the limits of points and units.

    Raises:
        BadInput: If it has too many.
    """
    if points > MOST_POINTS:
        raise BadInput(f"{points} worlds, variants and planners in all; a batch has {MOST_POINTS} at most")
    ranges = -(-trials // unit_trials)
    units = points * seeds * ranges
    if units > MOST_UNITS:
        raise BadInput(f"{units} units (worlds and variants: {points}, seeds: {seeds}, ranges of trials: {ranges}); a "
                       f"batch has {MOST_UNITS} at most: take fewer seeds, or more trials a unit (--unit-trials)")


def grid_of(document: Part, settings: BatchSettings) -> Grid:
    """The grid of the settings in a batch's manifest.

    Raises:
        BadFile: If a world there is invalid, or has another name than its key.
        BadInput: If it has too many units.
    """
    stored = settings.options
    options = Options(
        trials=stored.trials, rollouts=stored.rollouts, fidelity=stored.fidelity, evpi=stored.evpi,
        policies=stored.policies, news=stored.news, anticipate=bool(stored.anticipate),
        calibrate=None if stored.calibrate is None else target_of(stored.calibrate),
        limits=SolveLimits(time_limit_s=stored.time_limit_s, gap=stored.gap))
    points = []
    for name, entry in settings.points.items():
        at = ("points", name)
        world = world_of(Part(document, (*at, "world"), entry.world), _map_folder_at(document.path, entry))
        points.append(Point(world=world, planner=entry.planner, variant=entry.variant,
                            settings=dict(entry.settings)))
        if points[-1].name != name:
            raise document.error(at, f"its world and variant are those of {points[-1].name!r}")
    return checked(Grid(points=points, seeds=settings.seeds, options=options, unit_trials=settings.unit_trials,
                        own=dict(settings.own)))


def _map_folder(digests: Mapping[str, str]) -> str:
    return f"map-{digest(digests)[:12]}"


def _map_folder_at(path: Path, entry: PointEntry) -> Path:
    """The folder of the files that a point's world names."""
    return path.parent if entry.files is None else path.parent / _map_folder(entry.files)


def batch_name(settings: BatchSettings) -> str:
    """Default name of a batch folder: equal batches get equal names."""
    return f"batch-{digest(as_dict(settings))[:8]}"


def options_at(grid: Grid, point: Point, seed: int) -> Options:
    """The options of one point and seed."""
    return replace(grid.options, seed=seed, planner=point.planner)
