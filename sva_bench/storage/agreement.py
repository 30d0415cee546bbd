"""Whether the files of a run folder are of one run: outcomes of the summary's trials, plans of the routes driven."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sva_bench.errors import BadFile
from sva_bench.files.printable import counted
from sva_bench.storage.run_folder import Legs
from sva_bench.storage.tables import OUTCOMES, pieces_of

_AGREE = 1e-6  # relative tolerance of means that are summed in another order
_AGAIN = "run the command in manifest.json again"

Routes = Mapping[tuple[str, str], Mapping[str, Sequence[str]]]
"""Route of each robot, by scenario and planner."""


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


def check_outcomes(path: Path, plans: Mapping[tuple[str, str], float], trials: int,
                   loss_cost: Mapping[str, float], words: Mapping[str, frozenset[str]]
                   ) -> dict[tuple[str, str, str], StopsReached]:
    """Check that outcomes have a row for each trial and robot, and the means of the summary; the stops reached.

    Args:
        path: The table.
        plans: Mean value by scenario and planner.
        trials: How many there are.
        loss_cost: Cost of each robot if it doesn't come home.
        words: What columns of words may hold.

    Returns:
        Stops reached, by scenario, planner and robot.

    Raises:
        BadFile: If they don't.
    """
    robots = len(loss_cost)
    sums = {column: dict.fromkeys(plans, 0.0) for column in ("incentive", "value")}
    counts = dict.fromkeys(plans, 0)
    reached: dict[tuple[str, str, str], StopsReached] = {}
    for piece in pieces_of(path, OUTCOMES, rows=len(plans) * trials * robots, words=words):
        grouped = piece.group_by(["scenario", "planner", "robot", "end"]).aggregate([
            ("incentive", "sum"), ("lost", "sum"), ("value", "sum"), ("trial", "count"),
            ("stops_reached", "min"), ("stops_reached", "max")])
        for row in grouped.to_pylist():
            key = row["scenario"], row["planner"]
            sums["incentive"][key] += row["incentive_sum"] - loss_cost[row["robot"]] * row["lost_sum"]
            sums["value"][key] += row["value_sum"]
            counts[key] += row["trial_count"]
            whose = *key, row["robot"]
            reached[whose] = reached.get(whose, StopsReached()).also(
                row["stops_reached_min"], row["stops_reached_max"], home=row["end"] == "home")
    for (scenario, name), mean in plans.items():
        for column, by_plan in sums.items():
            found = by_plan[scenario, name] / trials
            if counts[scenario, name] != trials * robots or not np.isclose(found, mean, rtol=_AGREE, atol=_AGREE):
                raise BadFile(path, None, column, f"these aren't the trials of summary.json: {scenario}, {name} "
                              f"collected {mean:.6g} there and {found:.6g} here, in "
                              f"{counted(counts[scenario, name] // robots, 'trial')}; {_AGAIN}")
    return reached


def check_routes(files: Mapping[tuple[str, str], Path], routes: Routes, legs: Legs,
                 reached: Mapping[tuple[str, str, str], StopsReached]) -> None:
    """Check that what was driven are the routes of the plans.

    Args:
        files: Plan files, by scenario and planner; not those of perfect-information plans, which have other routes in
            each outcome.
        routes: Their routes.
        legs: The legs driven.
        reached: Stops reached, by scenario, planner and robot.

    Raises:
        BadFile: If a plan has another route than was driven.
    """
    for scenario, planner, robot, leg, origin, destination in sorted(set(zip(
            legs.scenario, legs.planner, legs.robot, legs.leg, legs.origin, legs.destination, strict=True))):
        if (scenario, planner) not in files:
            continue
        route = routes[scenario, planner].get(robot, ())
        if leg < 0 or tuple(route[leg:leg + 2]) != (origin, destination):
            raise BadFile(files[scenario, planner], None, f"routes.{robot}", "not the route that was driven: leg "
                          f"{leg} of legs.parquet goes from {origin!r} to {destination!r}; {_AGAIN}")
    for (scenario, planner, robot), found in reached.items():
        if (scenario, planner) not in files:
            continue
        route = routes[scenario, planner].get(robot, ())
        stops = len(route) - 1 if len(set(route)) > 1 else 0  # what never leaves the base reaches no stop
        if found.most > stops or found.home not in (None, (stops, stops)):
            raise BadFile(files[scenario, planner], None, f"routes.{robot}", "not the route that was driven: it has "
                          f"{counted(stops, 'stop')} after the base, and {found.most} were reached in "
                          f"outcomes.parquet; {_AGAIN}")
