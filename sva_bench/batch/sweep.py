"""Sweeps: the grid of worlds, variants and seeds given by the command line or a ``sweep.yaml``."""

from __future__ import annotations

import json
import logging
import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_args

from pydantic import Field

from sva_bench.analysis.calibration import Target, target_of
from sva_bench.analysis.compared_values import own_value, variant_of
from sva_bench.batch.grid import MOST_POINTS, Grid, Point, checked, refuse_too_many
from sva_bench.choices import Departures, FailureProcess, Fidelity, Interaction, News, PathPlanner, PolicyName
from sva_bench.errors import BadFile, BadInput, SvaBenchError, nearest
from sva_bench.files.digest import digest
from sva_bench.files.documents import Document, Loc, parse_yaml, places_of, read_yaml, validate, value_at
from sva_bench.files.fields import Name, Number, Section, Seed
from sva_bench.files.patterns import has_pattern, matching
from sva_bench.files.printable import shown
from sva_bench.seeds import MOST_SEED
from sva_bench.solver.two_stage import SolveLimits
from sva_bench.study.inputs import asked_with
from sva_bench.study.options import Options, reactions_of
from sva_bench.study.reacting import misfit, news_of, policies_of
from sva_bench.workers.progress import OnProgress
from sva_bench.world.model import World
from sva_bench.world.variants import adapted, option_of, world_with

_log = logging.getLogger(__name__)
T = TypeVar("T")

KIND = "sva-bench/sweep@1"
UNIT_TRIALS = 10_000
UNIT_TRIALS_PHYSICS = 10
"""A unit should take seconds: a trial in physics takes seconds, a settled one microseconds."""

MOST_SEEDS = 100_000
_MANY = 100  # worlds and variants from which on reading them takes seconds


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """The settings of a batch; ``None`` = default.

    Attributes:
        worlds: World files.
        seeds: Seeds of failures and noise.
        trials, rollouts, fidelity, unit_trials: As for ``Options`` and ``Grid``.
        planners: How paths are planned.
        scenarios: Names of the scenarios to execute.
        margin, plan_failure, execute_failure, interaction, departures: In place of the worlds' own.
        policies, news, anticipate, calibrate, evpi: As for ``Options``.
        time_limit_s, gap: When a solve may stop.
        vary: Values by dotted key of a world file.
        compare: Varied keys whose values are compared, each with its reference if that is said.
        file: The sweep file that the settings are from, if any.
        from_options: Names of the settings given on the command line.
    """

    worlds: tuple[Path, ...] = ()
    seeds: tuple[int, ...] | None = None
    trials: int | None = None
    rollouts: int | None = None
    fidelity: Fidelity | None = None
    unit_trials: int | None = None
    planners: tuple[PathPlanner, ...] | None = None
    scenarios: tuple[str, ...] | None = None
    margin: float | None = None
    plan_failure: FailureProcess | None = None
    execute_failure: FailureProcess | None = None
    interaction: Interaction | None = None
    departures: Departures | None = None
    policies: tuple[PolicyName, ...] | None = None
    news: tuple[News, ...] | None = None
    anticipate: bool | None = None
    calibrate: Target | None = None
    evpi: bool | None = None
    time_limit_s: float | None = None
    gap: float | None = None
    vary: Mapping[str, Sequence[Any]] | None = None
    compare: tuple[str, ...] = ()
    file: Document | None = None
    from_options: frozenset[str] = frozenset()

    def wrong(self, setting: str, loc: Loc, option: str, problem: str) -> SvaBenchError:
        """The error of a setting, attributed to its option, or to its location in the sweep file."""
        if self.file is None or setting in self.from_options:
            return BadInput(f"{option}: {problem}")
        return self.file.error(loc, problem)


class _SweepFile(Section):
    format: Literal["sva-bench/sweep@1"]
    worlds: list[str] = Field(min_length=1, max_length=MOST_POINTS)
    seeds: Annotated[list[Seed | str], Field(max_length=MOST_SEEDS)] | Seed | str | None = None
    trials: int | None = Field(default=None, ge=1, le=10_000_000)
    rollouts: int | None = Field(default=None, ge=1, le=100_000)
    fidelity: Fidelity | None = None
    unit_trials: int | None = Field(default=None, ge=1)
    planners: list[PathPlanner] | None = Field(default=None, min_length=1)
    scenarios: list[Name] | None = Field(default=None, min_length=1)
    margin: Number | None = Field(default=None, ge=0, le=1)
    plan_failure: FailureProcess | None = None
    execute_failure: FailureProcess | None = None
    interaction: Interaction | None = None
    departures: Departures | None = None
    policy: Annotated[list[str], Field(min_length=1)] | str | None = None
    news: Annotated[list[str], Field(min_length=1)] | str | None = None
    anticipate: bool | None = None
    calibrate: str | None = None
    evpi: bool | None = None
    time_limit_s: Number | None = Field(default=None, ge=0)
    gap: Number | None = Field(default=None, ge=0)
    set: dict[str, list[Any]] | None = None
    compare: Annotated[list[str], Field(min_length=1)] | str | None = None


def sweep_of(paths: Sequence[Path], from_options: Sweep) -> Sweep:
    """The sweep of these files, worlds or one ``sweep.yaml``; options override the file.

    Raises:
        BadFile: If the sweep file is invalid.
        BadInput: If a pattern matches no file, or too many.
    """
    if len(paths) == 1 and paths[0].is_file() and (read := read_yaml(paths[0])).data is not None \
            and isinstance(read.data, dict) and str(read.data.get("format", "")).startswith("sva-bench/sweep"):
        from_file = _from_file(read)
        settings = {key: value for key, value in vars(from_options).items() if value not in (None, (), frozenset())}
        return replace(from_file, **settings, from_options=frozenset(settings))
    return replace(from_options, worlds=tuple(path for given in paths for path in _matching(given)))


def _from_file(document: Document) -> Sweep:
    file = validate(document, _SweepFile, KIND)
    seeds = _words_at(document, "seeds", file.seeds, seeds_of)
    policies = _words_at(document, "policy", file.policy, policies_of)
    news = _words_at(document, "news", file.news, news_of)
    targets = _words_at(document, "calibrate", file.calibrate, lambda words, what: (target_of(words[0], what),))
    for key, values in (file.set or {}).items():
        if not values:
            raise document.error(("set", key), "give at least one value")
    worlds: list[Path] = []
    for number, word in enumerate(file.worlds):
        try:
            worlds += _matching(document.path.parent / word)
        except BadInput as error:
            raise document.error(("worlds", number), str(error)) from None
    return Sweep(
        worlds=tuple(worlds), seeds=seeds, trials=file.trials, rollouts=file.rollouts, fidelity=file.fidelity,
        unit_trials=file.unit_trials, planners=tuple(file.planners) if file.planners else None,
        scenarios=tuple(file.scenarios) if file.scenarios else None, margin=file.margin,
        plan_failure=file.plan_failure, execute_failure=file.execute_failure, interaction=file.interaction,
        departures=file.departures, policies=policies, news=news, anticipate=file.anticipate, evpi=file.evpi,
        calibrate=targets[0] if targets else None, time_limit_s=file.time_limit_s, gap=file.gap, vary=file.set,
        compare=(file.compare,) if isinstance(file.compare, str) else tuple(file.compare or ()), file=document)


def _words_at(
    document: Document, key: str, written: Sequence[str | int] | str | int | None,
    parse: Callable[[Sequence[str], str], tuple[T, ...]],
) -> tuple[T, ...] | None:
    """What an option of one word or several means, as a key of the sweep file has it; ``None`` = nothing."""
    given = [] if written is None else [written] if isinstance(written, str | int) else written
    try:
        return parse([str(word) for word in given], "") if given else None
    except BadInput as error:
        raise document.error((key,), str(error)) from None


def _matching(given: Path) -> list[Path]:
    """The files that a pattern matches; the path itself where it is none.

    Raises:
        BadInput: If none match, or too many, or too many places would have to be looked at.
    """
    if given.exists() or not has_pattern(given):
        return [given]
    found = matching(given, MOST_POINTS)
    if not found:
        raise BadInput(f"{given}: no file matches")
    return found


def seeds_of(words: Sequence[str], what: str = "--seed ") -> tuple[int, ...]:
    """Seeds of an option: ``3``, ``0-9``, ``1,5,7-9``.

    Raises:
        BadInput: If they are no seeds, too many, or duplicates.
    """
    seeds: list[int] = []
    for part in ",".join(words).split(","):
        ends = part.strip().split("-")
        if len(ends) > 2 or not all(end.strip().isdecimal() for end in ends):
            raise BadInput(f"{what}{part.strip()!r}: expected an integer, or a range like 0-9")
        if any(len(end) > 100 or int(end) > MOST_SEED for end in ends):
            raise BadInput(f"{what}{shown(part.strip())}: a seed is {MOST_SEED} at most (2^63 - 1)")
        first, last = int(ends[0]), int(ends[-1])
        if last < first or last - first >= MOST_SEEDS:
            raise BadInput(f"{what}{part.strip()!r}: a range goes from the smaller to the greater, over "
                           f"{MOST_SEEDS} seeds at most")
        seeds += range(first, last + 1)
        if len(seeds) > MOST_SEEDS:
            raise BadInput(f"{what}{part.strip()!r}: more than {MOST_SEEDS} seeds in all")
    duplicate = next((seed for seed, count in Counter(seeds).items() if count > 1), None)
    if duplicate is not None:  # the same trials again would pass for more of them
        raise BadInput(f"{what}{shown(','.join(words))}: the seed {duplicate} is given twice; give each once")
    return tuple(seeds)


def planners_of(words: Sequence[str]) -> tuple[PathPlanner, ...]:
    """Path planners of an option, in their canonical order.

    Raises:
        BadInput: If one is unknown or a duplicate.
    """
    known = get_args(PathPlanner)
    for word in words:
        if word not in known:
            raise BadInput(f"--planner {word}: there is no such planner; {nearest(word, list(known))}")
        if words.count(word) > 1:
            raise BadInput(f"--planner {word}: given twice; give it once")
    return tuple(planner for planner in known if planner in words)


def varied(words: Sequence[str]) -> dict[str, list[Any]]:
    """Values by key of options such as ``robots.uv2.fuel_capacity_s=200,250,300``, in the syntax of a world file.

    Raises:
        BadInput: If one has another form, or a key is a duplicate.
    """
    vary: dict[str, list[Any]] = {}
    for word in words:
        key, equals, values = word.partition("=")
        if not (key and equals and values.strip()):
            raise BadInput(f"--set {word}: expected KEY=VALUE,VALUE,...")
        if key in vary:
            raise BadInput(f"--set {key}: told twice; put all its values into one")
        try:
            vary[key] = parse_yaml(f"[{values}]", Path(f"--set {key}")).data
        except BadFile as error:
            raise BadInput(f"--set {word}: {error.problem}") from None
        if not isinstance(vary[key], list) or not vary[key]:
            raise BadInput(f"--set {word}: expected KEY=VALUE,VALUE,...")
    return vary


def grid_of(sweep: Sweep, progress: OnProgress = lambda *_: None) -> Grid:
    """The grid of a sweep.

    Args:
        sweep: The sweep.
        progress: Called as worlds are read: with all variants they may be thousands.

    Raises:
        BadFile: If a world is wrong, as it is or varied.
        BadInput: If two worlds share a name, or values don't differ.
    """
    vary = sweep.vary or {}
    planners = sweep.planners or ("prmstar",)
    for key, values in vary.items():
        if len({json.dumps(value) for value in values}) < len(values):
            raise sweep.wrong("vary", ("set", key), f"--set {key}", "a value is a duplicate")
    if len(set(planners)) < len(planners):
        raise sweep.wrong("planners", ("planners",), "--planner", "a planner is a duplicate; name each once")
    options = _options_of(sweep)
    unit_trials = sweep.unit_trials or (UNIT_TRIALS_PHYSICS if options.fidelity == "physics" else UNIT_TRIALS)
    seeds = sweep.seeds or (0,)
    # Before anything is read or expanded: a few lines can define an astronomically large grid.
    count = len(sweep.worlds) * math.prod(map(len, vary.values()))
    refuse_too_many(count * len(planners), len(seeds), options.trials, unit_trials)
    points: list[Point] = []
    own = _own_values(sweep, vary)
    first_with_effect: dict[tuple[int, str], str] = {}
    from_options: set[str] = set()
    for number, (world, variant) in enumerate(_worlds_of(sweep, vary)):
        if unfit := misfit(world, options.policies, options.news, anticipate=options.anticipate):
            raise sweep.wrong(unfit.option, (unfit.option,), f"--{unfit.option}", unfit.problem)
        before = first_with_effect.setdefault(_effective(world, options), variant_of(variant))
        if before != variant_of(variant) and world.name not in from_options:  # once: there may be thousands
            from_options.add(world.name)
            _log.warning("%s: %s changes nothing against %s: its scenarios, or other keys, say otherwise", world.name,
                         variant_of(variant), before)
        if count >= _MANY:
            progress("reading worlds", number, count)
        for planner in planners:
            settings = {**variant, **({"planner": planner} if len(planners) > 1 else {})}
            points.append(Point(world=world, planner=planner, variant=variant_of(settings), settings=settings))
    for key in sorted(_IN_PHYSICS_ALONE & set(vary)) if options.fidelity == "kinematic" else ():
        _log.warning("%s is varied to no effect: kinematic trials know nothing of it", key)
    return checked(Grid(points=points, seeds=seeds, options=options, unit_trials=unit_trials, own=own))


def _own_values(sweep: Sweep, vary: Mapping[str, Sequence[Any]]) -> dict[str, str]:
    """Of varied keys, the value that leaves the world files as they are, where it is among theirs."""
    documents = [read_yaml(path).data for path in sweep.worlds] if vary else []
    found = {key: own_value(values, [value_at(data, place) for data in documents for place in places_of(data, key)])
             for key, values in vary.items()}
    return {key: own for key, own in found.items() if own is not None}


_IN_PHYSICS_ALONE = {"noise.payload_kg", "noise.hull_friction"}


def _options_of(sweep: Sweep) -> Options:
    return Options(
        trials=sweep.trials or 1000, rollouts=sweep.rollouts or 32, fidelity=sweep.fidelity or "rollout",
        limits=SolveLimits(time_limit_s=sweep.time_limit_s, gap=1e-6 if sweep.gap is None else sweep.gap),
        policies=sweep.policies or (), news=sweep.news or (), anticipate=bool(sweep.anticipate),
        calibrate=sweep.calibrate, evpi=bool(sweep.evpi))


def _worlds_of(sweep: Sweep, vary: Mapping[str, Sequence[Any]]) -> Iterator[tuple[World, dict[str, str]]]:
    """Each world of a sweep with each combination of values, and the variant's settings."""
    files: dict[str, Path] = {}
    from_file: dict[str, World] = {}
    for path in sweep.worlds:
        document = asked_with(read_yaml(path), sweep.interaction)
        for chosen in product(*vary.values()):
            values = dict(zip(vary, chosen, strict=True))

            def wrong(key: str, problem: str, values: Mapping[str, Any] = values) -> SvaBenchError:
                return sweep.wrong("vary", ("set", key), option_of(key, values), problem)

            world = world_with(document, values, wrong)
            other = files.setdefault(world.name, path)
            if other is not path:
                raise BadInput(f"{path}: its world is named {world.name!r}, as that of {other}; names must differ "
                               "within a batch: change one" if other != path else f"{path}: this world is given twice")
            for number, name in enumerate(sweep.scenarios or ()):
                known = [scenario.name for scenario in world.scenarios]
                if name not in known:
                    raise sweep.wrong("scenarios", ("scenarios", number), f"--scenario {name}",
                                      f"{path} has no scenario {name!r}; {nearest(name, known)}")
                if name in (sweep.scenarios or ())[:number]:
                    raise sweep.wrong("scenarios", ("scenarios", number), f"--scenario {name}",
                                      "given twice; give it once")
            yield (_sharing(adapted(world, sweep.scenarios, sweep.margin, sweep.plan_failure, sweep.execute_failure,
                                    sweep.interaction, sweep.departures), from_file),
                   {key: json.dumps(value) for key, value in values.items()})


def _effective(world: World, options: Options) -> tuple[int, str]:
    """A key of all that trials depend on in a world, with these options; equal obstacles are one object (``_sharing``).

    Availabilities under ``robots:`` are those of scenarios that don't say otherwise, and of nothing else.
    """
    robots = [replace(robot, availability=1.0, urdf=None) for robot in world.robots]  # its model says all of a URDF
    sites = world.sites if world.meets else [replace(site, slots=1) for site in world.sites]
    return id(world.obstacles), digest(world.name, sites, robots, world.scenarios, world.plan_failure,
                                       world.execute_failure, world.margin, world.noise, world.passages,
                                       (world.interaction, world.departures) if world.meets else "",
                                       reactions_of(world, options))


def _sharing(world: World, from_file: dict[str, World]) -> World:
    """The world, sharing equal obstacles and map files with earlier ones, so that thousands fit in memory."""
    source = world.map_source
    first = from_file.setdefault(digest(world.obstacles, world.digests()), world)
    if source is not None and first.map_source is not None:
        source = replace(source, files=first.map_source.files)
    return replace(world, obstacles=first.obstacles, map_source=source)
