"""Run folders: tables, plans and summary, written under a temporary name and renamed when complete."""

from __future__ import annotations

import contextlib
import hashlib
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from sva_bench import __version__
from sva_bench.arrays import FloatArray
from sva_bench.execution.case import Settings
from sva_bench.execution.executed import Executed
from sva_bench.execution.reacted import Reacted
from sva_bench.files.atomic import draft_folder, remove_left_behind
from sva_bench.files.pretty import pretty_json
from sva_bench.files.records import Record, as_dict
from sva_bench.storage.outcome_table import outcome_table
from sva_bench.storage.tables import LEGS, OUTCOMES, TRAVEL_TIMES, write_table
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.maps.files import MapFile

_RUN_NAME = re.compile(r".+-seed\d+-[0-9a-f]{8}")


def run_name(world: str, seed: int, identity: Mapping[str, Any]) -> str:
    """Name of a run folder: equal runs get equal names.

    Args:
        world: The world's name.
        seed: The seed.
        identity: Everything that the results depend on: the resolved world, and the options that change results.
    """
    text = json.dumps({"version": __version__, "seed": seed, **identity}, sort_keys=True)
    return f"{world}-seed{seed}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"


@contextlib.contextmanager
def run_folder(out: Path, name: str) -> Iterator[Path]:
    """A folder that appears as ``out / name`` only when it is complete; it replaces an older one in one step.

    Raises:
        BadInput: If ``out`` cannot be written to.
    """
    tidy(out)
    with draft_folder(out / name, "choose another with --out") as draft:
        yield draft


def tidy(out: Path) -> None:
    """Remove stale drafts of killed runs, and restore older runs that they had moved away."""
    remove_left_behind(out, lambda left: _RUN_NAME.fullmatch(left) is not None)


def stem_of(scenario: str, planner: str, *, foreign: bool) -> str:
    """The unique name of a plan's files under a scenario.

    Planners' own names have no ``+``, and none is the end of another; given plans may have any name.

    Args:
        scenario: The scenario's name.
        planner: The planner's, or that of a plan from elsewhere.
        foreign: Whether the plan is from elsewhere.
    """
    return f"{scenario}{'+' if foreign else '-'}{planner}"


def recording_stem(key: tuple[str, str, str, str], trial: int | str | None = None, *, foreign: bool) -> str:
    """The unique name of a recording.

    ``+`` ends the planner's name, as planners' own names have none. Given plans may have any name, which therefore
    stands last, after what no name of a scenario has: ``@``.

    Args:
        key: Scenario, planner, policy and news.
        trial: The trial that was asked for, by its number or as in ``worst``; ``None``: the usual one.
        foreign: Whether the plan is from elsewhere.
    """
    scenario, planner, policy, news = key
    which = "-".join([*([] if policy == "none" else [policy, news]), *(
        [] if trial is None else [trial if isinstance(trial, str) else f"trial{trial}"])])
    if not which:
        return stem_of(scenario, planner, foreign=foreign)
    return f"{scenario}@{which}+{planner}" if foreign else f"{scenario}-{planner}+{which}"


def pair_stem(scenario: str, *, foreign: bool) -> str:
    """The unique name of the recording that shows two plans side by side; a given plan may be called ``compare``."""
    return f"{scenario}{'@' if foreign else '+'}compare"


def made_for(planner: str, news: str) -> str:
    """What a plan that was made for a reaction is called in the names of files."""
    return f"{planner}-{news}"


def write_record(path: Path, record: Record) -> None:
    """Write a record as a JSON file that a person can read."""
    # A name that is no UTF-8 becomes an escape as JSON has it.
    path.write_bytes(pretty_json(as_dict(record)).encode("utf-8", "backslashreplace"))


def write_map(folder: Path, files: Iterable[MapFile]) -> None:
    """Write the files that a world names, of its map and robots, as ``map/`` and the names that they have there."""
    for file in files:
        path = folder / MAP / file.name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(file.content)


def travel_table(costs: Mapping[str, FuelCosts]) -> pa.Table:
    """Travel times and their repair: a row per directed pair and robot model, or robot where robots meet."""
    rows: dict[str, list[Any]] = {key: [] for key in ("origin", "destination", "model", "raw_s", "repaired_s", "via")}
    for kind, cost in costs.items():
        sites = cost.times.sites
        for i, origin in enumerate(sites):
            for j, destination in enumerate(sites):
                if i == j:
                    continue
                rows["origin"].append(origin)
                rows["destination"].append(destination)
                rows["model"].append(kind)
                rows["raw_s"].append(int(cost.times.time_ms[i, j]) / 1000)
                rows["repaired_s"].append(int(cost.repaired_ms[i, j]) / 1000)
                rows["via"].append(sites[int(cost.via[i, j])])
    return pa.table(rows, schema=TRAVEL_TIMES)


def write_travel_times(path: Path, costs: Mapping[str, FuelCosts]) -> None:
    """Write ``travel_times.parquet``."""
    write_table(path, TRAVEL_TIMES, [travel_table(costs)])


MAP = "map"
"""Folder in a run folder that holds the files that the world names, of its map and robots, under their names there."""



@dataclass(frozen=True, eq=False, kw_only=True)
class Legs:
    """The columns of ``legs.parquet``, with a row per leg driven; the units are in its schema."""

    scenario: Sequence[str]
    planner: Sequence[str]
    policy: Sequence[str]
    news: Sequence[str]
    trial: Sequence[int]
    rollout: Sequence[int]
    robot: Sequence[str]
    leg: Sequence[int]
    origin: Sequence[str]
    destination: Sequence[str]
    planned_s: FloatArray
    driven_s: FloatArray
    waited_s: FloatArray
    cut_short: Sequence[bool]

    def without_reaction(self) -> Legs:
        """Those of teams that keep their plans."""
        kept = [k for k, policy in enumerate(self.policy) if policy == "none"]
        columns: dict[str, Any] = {
            name: column[kept] if isinstance(column, np.ndarray) else [column[k] for k in kept]
            for name, column in vars(self).items()}
        return Legs(**columns)


def legs_of(executed: Sequence[Executed | Reacted]) -> Legs:
    """All legs driven in some runs."""
    rows = [(run.case, leg) for run in executed for leg in run.legs]
    return Legs(
        scenario=[case.scenario.name for case, _ in rows], planner=[case.planner for case, _ in rows],
        policy=[case.policy for case, _ in rows], news=[case.news for case, _ in rows],
        trial=[leg.trial for _, leg in rows], rollout=[leg.rollout for _, leg in rows],
        robot=[leg.robot for _, leg in rows], leg=[leg.leg for _, leg in rows], origin=[leg.origin for _, leg in rows],
        destination=[leg.destination for _, leg in rows],
        planned_s=np.array([leg.planned_s for _, leg in rows], dtype=np.float64),
        driven_s=np.array([leg.driven_s for _, leg in rows], dtype=np.float64),
        waited_s=np.array([leg.waited_s for _, leg in rows], dtype=np.float64),
        cut_short=[leg.cut_short for _, leg in rows])


def write_legs(path: Path, legs: Legs) -> None:
    """Write ``legs.parquet``."""
    write_table(path, LEGS, [pa.table(vars(legs), schema=LEGS)])


def write_outcomes(path: Path, executed: Sequence[Executed | Reacted], robots: Sequence[str], settings: Settings,
                   seen: Callable[[pa.Table], None] = lambda _: None) -> None:
    """Write ``outcomes.parquet``: a row per scenario, plan, reaction, trial and robot; ``seen`` gets each piece."""
    def pieces() -> Iterator[pa.Table]:
        for run in executed:
            piece = outcome_table(run, robots, settings)
            seen(piece)
            yield piece

    write_table(path, OUTCOMES, pieces())
