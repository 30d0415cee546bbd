"""The plans on the map: a route for each leg, along the paths that the run has, and marks where robots ended."""

from __future__ import annotations

import base64
import html
import io
import itertools
import re
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from PIL import Image

from sva_bench.analysis.reaction_results import ReactionResult
from sva_bench.analysis.summaries import Summary
from sva_bench.geometry.buckets import clearances
from sva_bench.geometry.cells import bounds_of, boxes_of
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.palette import ROBOTS, hex_of, plan_color
from sva_bench.report.mark_labels import place_words
from sva_bench.report.page_style import STYLE
from sva_bench.report.plan_view import PlanView, _coarser, frame_of
from sva_bench.report.reaction_shares import value_without
from sva_bench.report.route_maps import _telling_with, beside, route_maps
from sva_bench.storage.leg_paths import _corners
from sva_bench.storage.stored_run import Content, read_content
from sva_bench.storage.trial_counts import Counting
from sva_bench.study.options import Options
from sva_bench.study.publish import report_again
from sva_bench.study.run import run
from sva_bench.world.maps.ros import read_ros_map
from tests.results_for_tests import reaction
from tests.world.maps_for_tests import write_ros_map
from tests.worlds_for_tests import SMALL, world_of

WORLDS = {
    "failures of missions": SMALL,
    "failures on legs": SMALL.replace("safe: {uv2: 1.0}", "safe: {uv1: 0.6, uv2: 0.6}") + "failure: per_leg\n",
    "a team that reacts": SMALL + "reaction: {policy: resolve, news: instant}\nfailure: per_leg\n",
}


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Path]:
    found = {}
    for name, text in WORLDS.items():
        folder = tmp_path_factory.mktemp("run")
        options = Options(trials=40, rollouts=2, fidelity="kinematic")
        found[name] = run(world_of(folder, text), options, folder / "runs", None, lambda *_: None).folder
    return found


@pytest.fixture(scope="module")
def contents(folders: Mapping[str, Path]) -> Mapping[str, Content]:
    return {name: read_content(folder) for name, folder in folders.items()}


def maps_of(content: Content) -> Mapping[tuple[str, str], str]:
    """The figure of each plan that is kept, by scenario and planner; plans of the same routes share one."""
    found = {}
    for figure in re.findall(r"<figure class=map>.*?</figure>", "".join(route_maps(content))):
        said = re.search(r'aria-label="Routes of the (.*?) plan in (\w+)"', figure)
        assert said
        for name in said[1].split(" and "):
            found[said[2], name] = figure
    return found


@pytest.mark.parametrize("name", WORLDS)
def test_both_plans_have_a_map_in_each_scenario_with_a_route_for_each_leg(
        name: str, contents: Mapping[str, Content]) -> None:
    content = contents[name]
    maps = maps_of(content)
    for scenario in content.summary.scenarios:
        for planner in ("stochastic", "deterministic"):
            figure, number = maps[scenario.name, planner], 0
            for k, route in enumerate(content.routes[scenario.name, planner].values()):
                legs = [ends for ends in itertools.pairwise(route) if ends[0] != ends[1]]
                assert figure.count(f'<g class="leg r{k}"') == len(legs)
                number += len(legs)
            assert number > 0
            assert hex_of(plan_color(planner, 0)) in figure


def test_a_leg_is_the_fainter_the_seldomer_it_is_driven(contents: Mapping[str, Content]) -> None:
    content = contents["failures of missions"]
    share = sum(found.share for found in content.counts.ended["half", "deterministic", "none", "never"]
                if found.robot == "uv2" and found.left)
    figure = maps_of(content)["half", "deterministic"]
    assert 0.2 < share < 0.8
    assert f'<g class="leg r1" style="--often:{share:.2f}"' in figure
    assert '<g class="leg r0" style' not in figure  # uv1 is always there


def test_marks_say_on_which_leg_how_often_robots_ended(
        folders: Mapping[str, Path], contents: Mapping[str, Content]) -> None:
    content, outcomes = contents["failures on legs"], pq.read_table(
        folders["failures on legs"] / "outcomes.parquet").to_pylist()
    mine = [row for row in outcomes if (row["scenario"], row["planner"], row["end"]) == (
        "safe", "stochastic", "failed")]
    counts: dict[tuple[str, int], int] = {}
    for row in mine:
        whose = row["robot"], row["stops_reached"]
        counts[whose] = counts.get(whose, 0) + 1
    figure = html.unescape(maps_of(content)["safe", "stochastic"])
    assert len(counts) > 2
    assert figure.count('<g class="ended">') == len(counts)
    for (robot, stops), count in counts.items():
        ends = content.routes["safe", "stochastic"][robot][stops:stops + 2]
        said = re.search(rf"{robot} failed on leg {stops + 1}, {' → '.join(ends)}: ([0-9.]+) % of missions", figure)
        assert said
        assert float(said[1]) == pytest.approx(100 * count / 40, abs=0.51)


def test_a_team_that_reacts_has_a_map_with_the_legs_driven_only_then(contents: Mapping[str, Content]) -> None:
    content = contents["a team that reacts"]
    (reacting,) = {figure for (scenario, name), figure in maps_of(content).items()
                   if scenario == "half" and "re-plans on instant news" in figure}
    best = content.summary.scenarios[0].reactions[0].best.plan  # type: ignore[index, union-attr]
    legs = content.legs
    driven = {(robot, a, b) for scenario, planner, policy, robot, a, b in zip(
        legs.scenario, legs.planner, legs.policy, legs.robot, legs.origin, legs.destination, strict=True)
        if (scenario, planner, policy) == ("half", best, "resolve")}
    planned = {(robot, *ends) for robot, route in content.routes["half", best].items()
               for ends in itertools.pairwise(route)}
    assert driven - planned
    assert reacting.count('<g class="leg replanned') == len(driven - planned)
    assert reacting.count("<path class=core") == len(driven - planned)  # hollow, whatever the dashes of its robot


def test_the_map_of_a_reaction_says_what_the_plan_is_worth_without_in_the_same_missions(
        contents: Mapping[str, Content]) -> None:
    content = contents["a team that reacts"]
    found = next(s for s in content.summary.scenarios if s.name == "half").reactions[0]  # type: ignore[index]
    assert isinstance(found, ReactionResult)
    told = [html.unescape(figure) for (name, _), figure in maps_of(content).items()
            if name == "half" and "re-plans" in figure]
    assert f"; {value_without(found, found.best.plan):.1f} without re-planning, in the same missions" in told[0]


def test_a_plan_whose_orders_no_reaction_changes_has_one_map(contents: Mapping[str, Content]) -> None:
    content = contents["a team that reacts"]
    assert isinstance(content.summary, Summary)

    def changed_in(share: float) -> Content:
        return replace(content, summary=replace(content.summary, scenarios=tuple(replace(s, reactions=tuple(
            replace(r, plans={name: replace(plan, reacted=share) for name, plan in r.plans.items()})
            for r in s.reactions or ())) for s in content.summary.scenarios)))  # type: ignore[arg-type]

    maps = {share: "".join(route_maps(changed_in(share))).count("<figure class=map>") for share in (0.0, 0.5)}
    assert 0 < maps[0.0] < maps[0.5]
    assert "re-plans" not in "".join(route_maps(changed_in(0.0)))


@pytest.mark.parametrize(("deterministic", "half", "shown"), [
    (90.0, 0.5, ["stochastic"]),  # ahead by 11, surely
    (100.0, 5.0, ["stochastic", "deterministic"]),  # ahead by 1, which is within the noise
    (102.0, 5.0, ["stochastic", "deterministic"]),  # behind as executed: the order of the plans all the same
    (110.0, 0.5, ["stochastic", "deterministic"])])  # noise turned what was found without
def test_the_map_of_a_reaction_is_of_the_best_plan_or_of_both_that_are_not_told_apart(
        deterministic: float, half: float, shown: list[str]) -> None:
    found = reaction("report", {"stochastic": (100.0, 101.0), "deterministic": (80.0, deterministic)}, half=half)
    assert _telling_with(found) == shown


@given(st.lists(st.tuples(st.floats(40, 380), st.floats(40, 380)), min_size=1, max_size=8),
       st.lists(st.sampled_from(["2.0 %", "13 %", "2", "< 0.1 %"]), min_size=8, max_size=8))
def test_the_word_of_a_mark_is_beside_it_and_hides_another_only_where_there_is_no_room(
        places: list[tuple[float, float]], words: list[str]) -> None:
    marks = [(x, y, 6.0) for x, y in places]
    found = place_words(marks, words[:len(marks)], [], (0.0, 0.0, 420.0, 420.0))
    for (x, y, radius), (wx, wy), word in zip(marks, found, words, strict=False):
        assert abs(wx - x) > radius or abs(wy - y) > radius  # off its own
        assert abs(wx - x) < radius + 3 * len(word) + 12
        assert abs(wy - y) < radius + 18
    (alone,) = place_words(marks[:1], words[:1], [], (0.0, 0.0, 420.0, 420.0))
    assert alone == pytest.approx((marks[0][0], marks[0][1] - 6.0 - 2.0 - 5.5))  # above, where there is room


def test_the_share_of_a_ring_gives_way_to_a_diamond_above_it() -> None:
    (x, y), _ = place_words([(100.0, 100.0, 6.0), (100.0, 86.0, 5.0)], ["2.0 %", "2"], [], (0.0, 0.0, 420.0, 420.0))
    assert y == pytest.approx(100.0)
    assert abs(x - 100.0) > 6.0


# Paths


def test_paths_lead_from_site_to_site_through_free_space(contents: Mapping[str, Content]) -> None:
    content = contents["failures of missions"]
    places = {site.name: (site.x_m, site.y_m) for site in content.world.sites}
    assert content.paths
    for (_, origin, destination), path in content.paths.items():
        assert_allclose(path[[0, -1]], [places[origin], places[destination]], atol=2e-3)
        dense = np.concatenate([np.linspace(a, b, 50) for a, b in itertools.pairwise(path)])
        # Robots keep their radius off obstacles; a centimetre is what simplifying a path may cost.
        assert clearances(content.world.obstacles, dense).min() > content.world.robots[0].model.radius_m - 0.02


def test_corners_that_are_left_out_lie_within_a_centimetre_of_the_path() -> None:
    path = np.array([[0.0, 0.0], [1.0, 0.009], [2.0, 0.0], [2.0, 1.0], [2.0, 1.5], [2.0, 2.0]])
    assert _corners(path) == [0, 2, 5]
    assert _corners(path + np.array([[0, 0], [0, 0.002], [0, 0], [0, 0], [0, 0], [0, 0]])) == [0, 1, 2, 5]
    assert _corners(np.array([[0.0, 0.0], [1.0, 1.0], [0.0, 0.0]])) == [0, 1, 2]  # there and back


def test_a_run_folder_without_paths_has_straight_routes_and_says_so(
        folders: Mapping[str, Path], tmp_path: Path) -> None:
    folder = Path(shutil.copytree(folders["failures of missions"], tmp_path / "run"))
    assert "along their planned paths" in (folder / "report.html").read_text(encoding="utf-8")
    (folder / "paths.parquet").unlink()
    report_again(folder)
    said = (folder / "report.html").read_text(encoding="utf-8")
    assert "straight from site to site, for this run folder holds no paths" in said
    assert said.count("<figure class=map>") == 3  # of safe, where both plans are the same, one


@pytest.mark.parametrize(("path", "off"), [
    (np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]]), np.array([[0.0, 2.0], [8.0, 2.0], [8.0, 10.0]])),
    (np.array([[0.0, 0.0], [0.0, 0.0], [10.0, 0.0]]), np.array([[0.0, 2.0], [10.0, 2.0]]))])
def test_a_lane_lies_to_the_right_of_its_path(path: np.ndarray, off: np.ndarray) -> None:
    # y grows downwards: right of a way to the right is below it.
    assert_allclose(beside(path, 2.0), off)


# The picture


@pytest.mark.parametrize("yaw", [0.0, 0.4])
def test_the_cells_of_a_grid_are_where_they_are_in_the_world(yaw: float, tmp_path: Path) -> None:
    write_ros_map(tmp_path, "#####\n#...#\n#.#.#\n#...#\n#####", origin=f"[-1, 2, {yaw}]")
    cells, _ = read_ros_map(tmp_path, "map.yaml")
    obstacles = Obstacles(bounds_m=bounds_of(cells), boxes=boxes_of(cells), cylinders=np.empty((0, 3)), cells=cells)
    small = world_of(tmp_path)
    x, y = cells.to_world(np.array([[1.5, 1.5]]) * cells.cell_m)[0]
    world = replace(small, obstacles=obstacles, sites=(replace(small.sites[0], x_m=float(x), y_m=float(y)),))
    view = PlanView(world)
    drawn = view.picture("a grid")
    moved = re.search(r'transform="matrix\((.*?)\)"', drawn)
    image = re.search(r'href="data:image/png;base64,(.*?)"', drawn)
    assert moved
    assert image
    a, b, c, d, e, f = map(float, moved[1].split())
    shown = np.asarray(Image.open(io.BytesIO(base64.b64decode(image[1]))).convert("RGBA"))[..., 3] > 0
    rows, columns = cells.occupied.shape
    for row in range(rows):
        for column in range(columns):
            middle = cells.to_world(np.array([[column + 0.5, row + 0.5]]) * cells.cell_m)
            u, v = column + 0.5, rows - row - 0.5  # in the image, whose rows begin above
            assert_allclose([a * u + c * v + e, b * u + d * v + f], frame_of(world).at(middle)[0], atol=0.1)
            assert shown[rows - 1 - row, column] == cells.occupied[row, column]
    again = view.picture("again")
    assert "data:image/png" not in again  # the ground is there once
    assert '<use href="#ground"/>' in again


@pytest.mark.parametrize(("step", "coarse"), [(1, [[1, 0, 0], [1, 1, 0], [0, 0, 0]]), (2, [[1, 1], [1, 1]])])
def test_a_coarser_grid_is_occupied_where_most_of_it_is(step: int, coarse: list[list[int]]) -> None:
    # Of the four cells at the lower left three are occupied; what lies outside a grid is.
    fine = np.array([[1, 0, 0], [1, 1, 0], [0, 0, 0]], dtype=np.bool_)
    assert _coarser(fine, step).astype(int).tolist() == coarse


# Counts


def test_counts_are_the_same_however_rows_are_cut_into_pieces(folders: Mapping[str, Path]) -> None:
    table = pq.read_table(folders["a team that reacts"] / "outcomes.parquet")
    found = []
    for size in (table.num_rows, 7, 1):
        counting = Counting(2)
        for start in range(0, table.num_rows, size):
            counting.add(table.slice(start, size))
        found.append(counting.result())
    assert found[0].values == found[1].values == found[2].values
    assert found[0].ended == found[1].ended == found[2].ended
    assert sum(count for _, count in found[0].values["half", "stochastic"]) == 40


def test_rows_in_another_order_have_no_values_rather_than_wrong_ones(folders: Mapping[str, Path]) -> None:
    table = pq.read_table(folders["failures of missions"] / "outcomes.parquet").sort_by("robot")
    counting = Counting(2)
    for start in range(0, table.num_rows, 50):
        counting.add(table.slice(start, 50))
    assert counting.result().values == {}


def test_every_robot_of_the_palette_has_its_line_on_the_page() -> None:
    for k, colour in enumerate(ROBOTS):
        assert f".leg.r{k} path{{stroke:{hex_of(colour)}" in STYLE


def test_that_the_informed_planner_has_no_map_is_said(folders: Mapping[str, Path]) -> None:
    content = read_content(folders["failures of missions"])
    assert not any("informed planner" in part for part in route_maps(content))
    assert isinstance(content.summary, Summary)
    first = content.summary.scenarios[0]
    knowing = replace(first, plans={**first.plans, "informed": first.plans["stochastic"]})
    said = route_maps(replace(content, summary=replace(content.summary, scenarios=(knowing,))))
    assert any("The informed planner has no map: its routes are others" in part for part in said)
