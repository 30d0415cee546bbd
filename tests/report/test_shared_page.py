"""The page of a run in which robots meet: legs cut short, collisions, berths, and robots that stay home."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from sva_bench.analysis.plan_names import ShownNames
from sva_bench.report import charts
from sva_bench.report.legs_section import legs_section
from sva_bench.report.marks import collisions, marks_of, met_in
from sva_bench.report.route_maps import route_maps
from sva_bench.report.run_page import _ends
from sva_bench.report.styles import robot_colour
from sva_bench.storage.stored_run import Content, read_content
from sva_bench.study.options import Options
from sva_bench.study.run import run
from tests.worlds_for_tests import SMALL, world_of

WORLDS = {
    "robots that collide": SMALL + "interaction: uncoordinated\n",
    "robots that fail on legs": SMALL.replace("safe: {uv2: 1.0}", "safe: {uv1: 0.3, uv2: 0.3}")
    + "interaction: shared\nfailure: hazard\n",
}


@dataclass(frozen=True, eq=False, kw_only=True)
class Finished:
    """A run folder, read again."""

    content: Content
    page: str
    outcomes: Sequence[Mapping[str, Any]]


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Finished]:
    found = {}
    for name, text in WORLDS.items():
        folder = tmp_path_factory.mktemp("run")
        options = Options(trials=24, rollouts=4)
        done = run(world_of(folder, text), options, folder / "runs", None, lambda *_: None).folder
        found[name] = Finished(content=read_content(done), page=(done / "report.html").read_text(),
                               outcomes=pq.read_table(done / "outcomes.parquet").to_pylist())
    return found


@pytest.fixture
def collided(runs: Mapping[str, Finished]) -> Finished:
    return runs["robots that collide"]


# Legs


@pytest.mark.parametrize("name", WORLDS)
def test_a_leg_is_marked_as_cut_short_exactly_if_its_robot_never_reached_its_end(
        name: str, runs: Mapping[str, Finished]) -> None:
    reached = {(row["scenario"], row["planner"], row["trial"], row["robot"]): row["stops_reached"]
               for row in runs[name].outcomes}
    legs = runs[name].content.legs
    ahead = [leg >= reached[scenario, planner, trial, robot] for scenario, planner, trial, robot, leg in zip(
        legs.scenario, legs.planner, legs.trial, legs.robot, legs.leg, strict=True)]
    assert legs.cut_short == ahead
    assert any(ahead)
    assert not all(ahead)


@pytest.mark.parametrize("name", WORLDS)
def test_the_page_leaves_legs_out_that_were_cut_short_and_says_how_many(
        name: str, runs: Mapping[str, Finished]) -> None:
    content = runs[name].content
    told = "".join(legs_section(content, ShownNames(content.summary.scenarios)))
    cut = sum(content.legs.cut_short)
    assert f"{cut} leg{'s' * (cut > 1)} not driven to the end" in told
    shown = [int(count) for count in re.findall(r"<tr><td class=text>uv\d</td><td>(\d+)</td>", told)]
    assert sum(shown) == sum(not short for short in content.legs.cut_short)
    whole = replace(content, legs=replace(content.legs, cut_short=[False] * len(content.legs.leg)))
    assert "not driven to the end" not in "".join(legs_section(whole, ShownNames(content.summary.scenarios)))


def test_time_and_fuel_of_a_leg_are_told_apart_where_robots_wait(runs: Mapping[str, Finished]) -> None:
    content = runs["robots that fail on legs"].content
    shown = ShownNames(content.summary.scenarios)
    waited = np.where(np.arange(len(content.legs.leg)) == content.legs.cut_short.index(False), 3.0, 0.0)
    for waits, said in ((waited, True), (0 * waited, False)):
        told = "".join(legs_section(replace(content, legs=replace(content.legs, waited_s=waits)), shown))
        assert "planned time of the leg = fuel" not in told
        assert ("Waits on the way are not in it" in told) == said
        assert ("rolls on slowly meanwhile" in told) == said


def test_a_robot_has_its_colour_whichever_robots_a_chart_shows() -> None:
    drawn = charts.legs_driven(np.array([1.0]), np.array([1.1]), ["uv2"], ["uv1", "uv2"])
    assert robot_colour(1).lower() in drawn
    assert robot_colour(0).lower() not in drawn


# What was met


def test_each_collision_counts_once_and_is_none_of_the_contacts_with_obstacles(collided: Finished) -> None:
    met = met_in(collided.content)
    rows = [row for row in collided.content.contacts.to_pylist() if row["solid"] in ("uv1", "uv2")]
    assert met["contact"] == []
    assert 2 * len(met["collision"]) == len(rows) > 0
    assert all(row["robots"] == "uv1 and uv2" and row["stuck"] for row in met["collision"])
    assert "Robots that collided" in collided.page
    assert "Obstacles that hulls touched" not in collided.page
    assert "a collision of two ends both" in collided.page


def row_of(robot: str, solid: str, *, trial: int = 0, stuck: bool = False) -> dict[str, Any]:
    return {"scenario": "S", "planner": "p", "trial": trial, "rollout": 0, "robot": robot, "solid": solid,
            "stuck": stuck}


def test_a_robot_that_runs_into_one_that_stands_tells_of_it_alone() -> None:
    # uv1 and uv2 collide and end; uv3 runs into uv1, whose mission is over, and so tells of nothing.
    rows = [row_of("uv1", "uv2", stuck=True), row_of("uv2", "uv1"), row_of("uv3", "uv1", stuck=True),
            row_of("uv1", "uv2", trial=1), row_of("uv1", "uv2", trial=1), row_of("uv2", "uv1", trial=1)]
    found = [(row["robots"], row["trial"], row["stuck"]) for row in collisions(rows, ["uv1", "uv2", "uv3"])]
    assert found == [("uv1 and uv2", 0, True), ("uv1 and uv3", 0, True), ("uv1 and uv2", 1, False),
                     ("uv1 and uv2", 1, False)]


def test_the_map_of_a_plan_has_the_berths_and_as_many_marks_as_there_were_collisions(collided: Finished) -> None:
    content = collided.content
    page = "".join(route_maps(content))
    (half, *_) = content.summary.scenarios
    assert re.findall(r"<title>berth of (uv\d)</title>", page) == ["uv1", "uv2"]  # once: all maps share the ground
    mine = [row for row in met_in(content)["collision"] if (row["scenario"], row["planner"]) == (
        half.name, "stochastic")]
    (drawn,) = (found for found in re.findall(r"<figure class=map>.*?</figure>", page)
                if f"stochastic plan in {half.name}" in found)
    marks = re.findall(r'<g class="met collision">.*?>(\d+)</text></g>', drawn)
    assert sum(map(int, marks)) == len(mine) > 0


def test_what_was_met_close_together_is_one_mark_with_its_number() -> None:
    rows = [{"x_m": x, "y_m": 1.0, "stuck": stuck} for x, stuck in ((1.0, False), (1.2, True), (2.0, False))]
    assert [(mark.count, mark.stuck) for mark in marks_of(rows, "contact")] == [(2, True), (1, False)]


# Ends


def test_a_robot_that_never_leaves_is_said_to_stay_home_and_not_to_come_home(collided: Finished) -> None:
    content = collided.content
    (first, *_) = content.summary.scenarios
    for route, said in (((), True), (("base",), True), (("base", "base"), True), (("base", "p1", "base"), False)):
        routes = {key: {**robots, "uv1": route, "uv2": ("base", "p1", "base")}
                  for key, robots in content.routes.items()}
        told = "".join(_ends([first], routes))
        assert told.count("stays home") == said * len(first.plans)
