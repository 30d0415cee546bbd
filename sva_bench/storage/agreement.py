"""Whether the files of a run folder are of one run: outcomes of the summary's trials, plans of the routes driven."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from sva_bench.arrays import IntArray
from sva_bench.errors import BadFile
from sva_bench.files.printable import counted
from sva_bench.storage.run_folder import Legs
from sva_bench.storage.tables import OUTCOMES, pieces_of

_AGREE = 1e-6  # relative tolerance of means that are summed in another order
_AGAIN = "run the command in manifest.json again"

Key = tuple[str, str, str, str]
"""Scenario, planner, policy and news."""

Routes = Mapping[Key, Mapping[str, Sequence[str]]]
"""Route of each robot."""


@dataclass(frozen=True, kw_only=True)
class StopsReached:
    """How many stops of its route a robot reached over all trials.

    Attributes:
        most: At most.
        home: Numbers found, the least and the greatest, where it came home; ``None`` if it never did.
    """

    most: int = 0
    home: tuple[int, int] | None = None

    def also(self, least: int, most: int, *, home: bool) -> StopsReached:
        """With some more trials, that ended at home or not."""
        ends = (least, most) if self.home is None else (min(self.home[0], least), max(self.home[1], most))
        return StopsReached(most=max(self.most, most), home=ends if home else self.home)


@dataclass(frozen=True, kw_only=True)
class Claim:
    """What a summary says of a plan's rows.

    Attributes:
        mean: Mean value.
        trials: How many trials they are of; ``None``: they are all histories.
        begins_whole: Whether nobody fails by draw in trial 0.
    """

    mean: float
    trials: int | None
    begins_whole: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Found:
    """What outcomes say of the routes driven.

    Attributes:
        reached: Stops reached by each robot, by scenario, planner and robot, where nobody reacts.
        whole: Plans with a reaction in whose trial 0 nothing happened: they were driven as they are.
    """

    reached: Mapping[tuple[str, str, str], StopsReached]
    whole: frozenset[Key]


@dataclass(frozen=True, kw_only=True)
class _Group:
    """Sums over the rows of one plan, robot and end; a field is named as Arrow names its column."""

    scenario: str
    planner: str
    policy: str
    news: str
    robot: str
    end: str
    weighted_incentive_sum: float
    weighted_lost_sum: float
    weighted_value_sum: float
    trial_count: int
    trial_min: int
    weight_sum: float
    weight_min: float
    weight_max: float
    history_min: int
    history_max: int
    stops_reached_min: int
    stops_reached_max: int

    @property
    def key(self) -> Key:
        """The plan and what its team does."""
        return self.scenario, self.planner, self.policy, self.news


class _Sums:
    """Sums over the rows of one plan, as they are read."""

    def __init__(self) -> None:
        self.rows = 0
        self.weight, self.by_column = 0.0, dict.fromkeys(("incentive", "value"), 0.0)
        self.lightest, self.heaviest = math.inf, -math.inf
        self.first_history, self.last_history = 2**63, -2**63
        self.histories: dict[int, dict[str, list[IntArray]]] = {}  # numbers, by noise draw and robot

    def add(self, group: _Group, loss_cost: float) -> None:
        """Add what some rows of one robot sum up to."""
        self.rows += group.trial_count
        self.weight += group.weight_sum
        self.by_column["incentive"] += group.weighted_incentive_sum - loss_cost * group.weighted_lost_sum
        self.by_column["value"] += group.weighted_value_sum
        self.lightest, self.heaviest = min(self.lightest, group.weight_min), max(self.heaviest, group.weight_max)
        self.first_history = min(self.first_history, group.history_min)
        self.last_history = max(self.last_history, group.history_max)

    def number(self, rollout: int, robot: str, histories: IntArray) -> None:
        """Add the numbers of some rows' histories."""
        self.histories.setdefault(rollout, {}).setdefault(robot, []).append(histories)

    def wrong_history(self, robots: int) -> int | None:
        """A noise draw under which the histories of some robot aren't 0, 1, 2, ... once each; ``None`` = all are."""
        for rollout, by_robot in self.histories.items():
            numbers = [np.sort(np.concatenate(found)) for found in by_robot.values()]
            if len(numbers) != robots or any(not np.array_equal(each, np.arange(len(numbers[0]))) for each in numbers):
                return rollout
        return None


def check_outcomes(path: Path, plans: Mapping[Key, Claim], loss_cost: Mapping[str, float],
                   words: Mapping[str, frozenset[str]], seen: Callable[[pa.Table], None] = lambda _: None) -> Found:
    """Check that outcomes have a row for each trial or history and robot, and the means of the summary.

    Args:
        path: The table.
        plans: What the summary says, by scenario, planner, policy and news.
        loss_cost: Cost of each robot if it doesn't come home.
        words: What columns of words may hold.
        seen: Gets each piece of the table that is read.

    Raises:
        BadFile: If they don't.
    """
    robots = len(loss_cost)
    known = [claim.trials for claim in plans.values() if claim.trials is not None]
    rows = sum(known) * robots if len(known) == len(plans) else None
    sums = {key: _Sums() for key in plans}
    reached: dict[tuple[str, str, str], StopsReached] = {}
    lost: set[Key] = set()
    for piece in pieces_of(path, OUTCOMES, rows=rows, words=words):
        for group in _grouped(piece):
            if group.key not in sums:
                raise BadFile(path, None, "policy", f"summary.json has no {_named(group.key)}; {_AGAIN}")
            sums[group.key].add(group, loss_cost[group.robot])
            if group.trial_min == 0 and group.end in ("failed", "out_of_fuel", "stuck"):
                lost.add(group.key)
            if group.policy == "none":
                whose = group.scenario, group.planner, group.robot
                reached[whose] = reached.get(whose, StopsReached()).also(
                    group.stops_reached_min, group.stops_reached_max, home=group.end == "home")
        for key, rollout, robot, histories in _numbered(piece):
            sums[key].number(rollout, robot, histories)
        seen(piece)
    for key, claim in plans.items():
        _check_sums(path, key, claim, sums[key], robots)
    return Found(reached=reached, whole=frozenset(key for key, claim in plans.items() if claim.begins_whole) - lost)


def _grouped(piece: pa.Table) -> list[_Group]:
    """Sums over the rows of each plan, robot and end."""
    weight = piece.column("weight")
    for column in ("incentive", "value", "lost"):
        piece = piece.append_column(f"weighted_{column}", pc.multiply(
            weight, pc.cast(piece.column(column), pa.float64())))
    found = piece.group_by(["scenario", "planner", "policy", "news", "robot", "end"], use_threads=False).aggregate([
        ("weighted_incentive", "sum"), ("weighted_lost", "sum"), ("weighted_value", "sum"), ("trial", "count"),
        ("trial", "min"), ("weight", "sum"), ("weight", "min"), ("weight", "max"), ("history", "min"),
        ("history", "max"), ("stops_reached", "min"), ("stops_reached", "max")]).to_pylist()
    return [_Group(**row) for row in found]


def _numbered(piece: pa.Table) -> Iterator[tuple[Key, int, str, IntArray]]:
    """Numbers of the histories of each plan, noise draw and robot, of the rows that have one."""
    found = piece.filter(pc.greater_equal(piece.column("history"), 0)).group_by(
        ["scenario", "planner", "policy", "news", "rollout", "robot"], use_threads=False).aggregate(
            [("history", "list")])
    histories = found.column("history_list")
    for number, row in enumerate(found.drop_columns("history_list").to_pylist()):
        key = row["scenario"], row["planner"], row["policy"], row["news"]
        yield key, row["rollout"], row["robot"], histories[number].values.to_numpy(zero_copy_only=False)


def _check_sums(path: Path, key: Key, claim: Claim, found: _Sums, robots: int) -> None:
    """Check the rows of one plan against what the summary says of them."""
    if claim.trials is None:
        if found.rows % robots or not np.isclose(found.weight, robots, rtol=_AGREE, atol=_AGREE) \
                or found.lightest < 0 or found.first_history != 0:
            raise BadFile(path, None, "weight", "these aren't all histories of failures: the probabilities of "
                          f"{_named(key)} add up to {found.weight / robots:.6g}; {_AGAIN}")
        if (rollout := found.wrong_history(robots)) is not None:
            raise BadFile(path, None, "history", f"expected the histories 0, 1, 2, ... once for each robot: those of "
                          f"{_named(key)} under noise draw {rollout} aren't; {_AGAIN}")
    elif found.rows != claim.trials * robots or (found.lightest, found.heaviest) != (1, 1) \
            or (found.first_history, found.last_history) != (-1, -1):
        raise BadFile(path, None, "trial", f"these aren't the trials of summary.json: {_named(key)} has "
                      f"{counted(claim.trials, 'trial')} there and {found.rows // robots} here; {_AGAIN}")
    for column, total in found.by_column.items():
        mean = total / (claim.trials or 1)
        if not np.isclose(mean, claim.mean, rtol=_AGREE, atol=_AGREE):
            raise BadFile(path, None, column, f"these aren't the trials of summary.json: {_named(key)} collected "
                          f"{claim.mean:.6g} there and {mean:.6g} here, in "
                          f"{counted(found.rows // robots, 'trial' if claim.trials else 'row')}; {_AGAIN}")


def _named(key: Key) -> str:
    """A plan as it is called in messages."""
    scenario, planner, policy, news = key
    return f"{scenario}, {planner}" + ("" if policy == "none" else f", {policy} on {news} news")


def check_routes(files: Mapping[Key, Path], routes: Routes, legs: Legs, found: Found) -> None:
    """Check that what was driven are the routes of the plans.

    What teams that react drove may be another: there the mission in which nothing happened is checked.

    Args:
        files: Plan files; not those of perfect-information plans, which have other routes in each outcome.
        routes: Routes of each of them.
        legs: The legs driven.
        found: What outcomes say.

    Raises:
        BadFile: If a plan has another route than was driven.
    """
    first: dict[Key, set[tuple[str, int, str, str]]] = {key: set() for key in found.whole}
    for *key, trial, robot, leg, origin, destination in sorted(set(zip(
            legs.scenario, legs.planner, legs.policy, legs.news, legs.trial, legs.robot, legs.leg, legs.origin,
            legs.destination, strict=True))):
        whose: Key = (key[0], key[1], key[2], key[3])
        if whose not in files:
            continue
        if whose[2] != "none":
            if trial == 0 and whose in first:
                first[whose].add((robot, leg, origin, destination))
            continue
        route = routes[whose].get(robot, ())
        if leg < 0 or tuple(route[leg:leg + 2]) != (origin, destination):
            raise BadFile(files[whose], None, f"routes.{robot}", "not the route that was driven: leg "
                          f"{leg} of legs.parquet goes from {origin!r} to {destination!r}; {_AGAIN}")
    for (scenario, planner, robot), reached in found.reached.items():
        whose = scenario, planner, "none", "never"
        if whose not in files:
            continue
        route = routes[whose].get(robot, ())
        stops = len(route) - 1 if len(set(route)) > 1 else 0  # what never leaves the base reaches no stop
        if reached.most > stops or reached.home not in (None, (stops, stops)):
            raise BadFile(files[whose], None, f"routes.{robot}", "not the route that was driven: it has "
                          f"{counted(stops, 'stop')} after the base, and {reached.most} were reached in "
                          f"outcomes.parquet; {_AGAIN}")
    for whose, driven in first.items():
        planned = {(robot, leg, *ends) for robot, route in routes[whose].items() if len(set(route)) > 1
                   for leg, ends in enumerate(pairwise(route))} if whose in files else driven
        if different := sorted(planned ^ driven):
            robot, leg, origin, destination = different[0]
            raise BadFile(files[whose], None, f"routes.{robot}", "not the route that was driven in trial 0, where "
                          f"nothing happened to react to: leg {leg} from {origin!r} to {destination!r} is in one of "
                          f"this and legs.parquet alone; {_AGAIN}")
