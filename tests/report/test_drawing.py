"""Pictures of worlds: to scale, the same each time, and in agreement with what the planner takes as free."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pybullet
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import imread
from numpy.testing import assert_array_equal

from sva_bench.__main__ import run_command_line
from sva_bench.arrays import FloatArray
from sva_bench.choices import Interaction, WorldFamily
from sva_bench.execution.engines.bodies import obstacles_urdf
from sva_bench.generate.terrain import random_places, random_terrain
from sva_bench.geometry.buckets import clearances
from sva_bench.geometry.cells import bounds_of, boxes_of
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.report import charts, drawing
from sva_bench.report.drawing import draw_world
from sva_bench.report.ground import frame_of
from sva_bench.report.labels import place_labels
from sva_bench.report.overlays import Kind, Leg, Overlays
from sva_bench.report.styles import OBSTACLE_RGB, ROBOTS, UNKNOWN_RGB
from sva_bench.study import pictures
from sva_bench.travel.berths import place_berths
from sva_bench.travel.roadmap import roadmap_edges
from sva_bench.world.maps.ros import read_ros_map
from sva_bench.world.model import World
from tests.oracles.distances import points_clearance
from tests.world.maps_for_tests import write_ros_map
from tests.worlds_for_tests import SMALL, world_of

ROUTE = Leg(destination="p1", path=np.array([[0.8, 0.8], [2.2, 0.8]]))


@pytest.fixture
def small(tmp_path: Path) -> World:
    return world_of(tmp_path)


def pixels(world: World, overlays: Overlays) -> FloatArray:
    """The picture as red, green and blue from 0 to 255, shape (rows, columns, 3)."""
    image: FloatArray = np.rint(imread(io.BytesIO(draw_world(world, "png", overlays)), format="png")[..., :3] * 255)
    return image


@pytest.mark.parametrize("family", ["small", "field", "aisles"])
def test_what_is_drawn_as_an_obstacle_is_one_and_what_is_white_is_free(family: str, small: World) -> None:
    world = small
    if family in ("field", "aisles"):
        kind: WorldFamily = "field" if family == "field" else "aisles"
        obstacles = random_terrain(kind, size_m=10, density=0.12, seed=2).obstacles
        x, y = random_places(obstacles, stations=0, pois=0, seed=2).base
        world = replace(small, obstacles=obstacles, sites=(replace(small.sites[0], x_m=x, y_m=y),))
    frame, image = frame_of(world), pixels(world, Overlays())
    # From a little outside the bounds, where the outer wall is.
    places = np.random.default_rng(0).uniform(frame.x0_m, frame.x1_m, (4000, 2))
    gap = points_clearance(world.obstacles, places)
    pixel_m = 1 / (frame.in_per_m * 200)
    colours = np.array([image[frame.pixel(x, y)] for x, y in places])
    solid, white = (colours == OBSTACLE_RGB).all(axis=1), (colours == 255).all(axis=1)
    assert (solid | white).mean() > 0.9  # the rest is markers, labels and edges
    assert solid.sum() > 100
    # Edges are blurred over a pixel, and boxes have a hairline: two pixels either way are left open.
    assert (gap[solid] < 2 * pixel_m).all()
    smaller = replace(
        world.obstacles, bounds_m=world.obstacles.bounds_m + np.array([-2, -2, 2, 2]) * pixel_m,
        boxes=world.obstacles.boxes - np.array([0, 0, 2, 2, 0]) * pixel_m,
        cylinders=world.obstacles.cylinders - np.array([0, 0, 2]) * pixel_m)
    assert (points_clearance(smaller, places[white]) > 0).all()


@pytest.mark.parametrize("yaw", [0.0, 0.4])
def test_picture_physics_and_planner_agree_on_what_is_free_on_a_map(yaw: float, small: World, tmp_path: Path) -> None:
    write_ros_map(tmp_path, "???????????\n?????????##\n?##########\n##....#...#\n#..##.....#\n#.....##?.#\n###########",
                  origin=f"[-1, 2, {yaw}]")
    cells, _ = read_ros_map(tmp_path, "map.yaml")
    obstacles = Obstacles(bounds_m=bounds_of(cells), boxes=boxes_of(cells), cylinders=np.empty((0, 3)), cells=cells)
    x, y = cells.to_world(np.array([[1.0, 1.25]]))[0]
    world = replace(small, obstacles=obstacles, sites=(replace(small.sites[0], x_m=float(x), y_m=float(y)),))
    frame, image = frame_of(world), pixels(world, Overlays())
    # The margin of nothing at the top is left out: only the rows with free cells and the frame's wall are seen.
    assert (frame.y1_m - frame.y0_m) < 0.8 * (obstacles.bounds_m[3] - obstacles.bounds_m[1])

    places = np.random.default_rng(0).uniform(
        np.maximum([frame.x0_m, frame.y0_m], obstacles.bounds_m[:2]),
        np.minimum([frame.x1_m, frame.y1_m], obstacles.bounds_m[2:]), (3000, 2))
    gap = clearances(obstacles, places)
    column, row = np.floor(cells.from_world(places) / cells.cell_m).astype(int).T
    inside = (row >= 0) & (row < cells.occupied.shape[0]) & (column >= 0) & (column < cells.occupied.shape[1])
    at = np.clip(row, 0, cells.occupied.shape[0] - 1), np.clip(column, 0, cells.occupied.shape[1] - 1)
    free = inside & ~cells.occupied[at]
    assert_array_equal(gap > 0, free)  # what the planner asks

    client = pybullet.connect(pybullet.DIRECT)
    try:
        (tmp_path / "obstacles.urdf").write_text(obstacles_urdf(obstacles))
        pybullet.loadURDF(str(tmp_path / "obstacles.urdf"), useFixedBase=True, physicsClientId=client)
        hits = [pybullet.rayTest([px, py, 2], [px, py, 0.01], physicsClientId=client)[0][0] for px, py in places]
    finally:
        pybullet.disconnect(physicsClientId=client)
    sure = ~free | (gap > 1e-3)  # a ray that grazes a box turned askew may hit it
    assert_array_equal((np.array(hits) < 0)[sure], free[sure])

    # Pictures are exact to two pixels; and which cells are unknown is seen on them.
    pixel_m = 1 / (frame.in_per_m * 200)
    colours = np.array([image[frame.pixel(px, py)] for px, py in places])
    known, unknown, white = ((colours == rgb).all(axis=1) for rgb in (OBSTACLE_RGB, UNKNOWN_RGB, 255))
    assert (known | unknown | white).mean() > 0.9
    assert (gap[known | unknown] < 2 * pixel_m).all()
    local = cells.from_world(places) / cells.cell_m % 1.0
    well_inside = (np.abs(local - 0.5) < 0.5 - 3 * pixel_m / cells.cell_m).all(axis=1) & (known | unknown | white)
    assert free[well_inside & white].all()
    assert cells.unknown is not None
    assert_array_equal(unknown[well_inside & inside & ~free], cells.unknown[at][well_inside & inside & ~free])
    assert unknown.sum() > 20


def test_the_same_world_gives_the_same_bytes_whatever_the_user_has_set_up(small: World) -> None:
    overlays = Overlays(roadmap=np.array([[[0.5, 0.5], [1.0, 3.0]]]), paths=(ROUTE.path,), routes={"uv1": [ROUTE]})
    kinds: tuple[Kind, ...] = ("png", "svg")
    for kind in kinds:
        first = draw_world(small, kind, overlays)
        with mpl.rc_context({"font.size": 20.0, "svg.hashsalt": None, "axes.facecolor": "red"}):
            assert draw_world(small, kind, overlays) == first
        assert b"dc:date" not in first


def test_roadmap_paths_and_routes_are_where_they_are_planned(small: World) -> None:
    frame, plain = frame_of(small), pixels(small, Overlays())
    at = frame.pixel(1.2, 0.8)  # a place on the route, away from its arrow and ends
    assert (plain[at] == 255).all()
    for overlays in (Overlays(routes={"uv1": [ROUTE]}), Overlays(paths=(ROUTE.path,)),
                     Overlays(roadmap=np.array([ROUTE.path]))):
        changed = (pixels(small, overlays) != plain).any(axis=2)
        row, column = at
        assert changed[row - 2:row + 3, column].any()
        assert not changed[frame.pixel(1.2, 3.0)]


def test_the_map_is_seen_through_a_roadmap_of_many_edges(small: World) -> None:
    edges = roadmap_edges(small.obstacles, np.array([(site.x_m, site.y_m) for site in small.sites]), 0.3)
    assert len(edges) > 5000
    plain = pixels(small, Overlays())
    ground = (plain == 255).all(axis=2)
    ground[:, int(0.75 * ground.shape[1]):] = False  # the legend's side
    ink = (255 - pixels(small, Overlays(roadmap=edges))[ground]).mean()
    assert 2 < ink < 15  # of 89 where lines cover everything; 30 with lines in full colour


def test_robots_are_distinguishable_without_colour() -> None:
    styles = [(str(style), width) for _, style, width in ROBOTS]
    assert len(set(styles)) == len(styles)


def test_labels_keep_off_markers_lines_and_each_other() -> None:
    # Two markers 30 apart with labels 60 wide: side by side they would collide.
    at, sizes = np.array([[100.0, 100.0], [130.0, 100.0]]), np.array([[60.0, 20.0], [60.0, 20.0]])
    line = np.column_stack([np.linspace(0, 100, 50), np.full(50, 100.0)])  # comes from the left
    centres = place_labels(at, sizes, radii=np.array([5.0, 5.0]), frame=np.array([0.0, 0.0, 200.0, 200.0]), lines=line,
                           solid=np.empty((0, 2)))
    low, high = centres - sizes / 2, centres + sizes / 2
    assert (low[0] >= high[1]).any() or (low[1] >= high[0]).any()
    for marker in at:
        assert ((marker + 5 <= low) | (marker - 5 >= high)).any(axis=1).all()
    assert not any(((point > a) & (point < b)).all() for point in line for a, b in zip(low, high, strict=True))


def test_labels_stay_inside_the_frame_in_a_corner() -> None:
    nothing = np.empty((0, 2))
    centres = place_labels(np.array([[6.0, 6.0]]), np.array([[40.0, 20.0]]), radii=np.array([5.0]), lines=nothing,
                           frame=np.array([0.0, 0.0, 200.0, 200.0]), solid=nothing)
    assert (centres - [20, 10] >= 0).all()


def test_a_label_does_not_end_beside_the_marker_of_another() -> None:
    # Between two markers there is just room for the label of the first, above or below there is plenty.
    nothing = np.empty((0, 2))
    at, sizes = np.array([[100.0, 100.0], [200.0, 100.0]]), np.array([[70.0, 20.0], [20.0, 10.0]])
    centres = place_labels(at, sizes, radii=np.array([5.0, 5.0]), frame=np.array([60.0, 0.0, 300.0, 200.0]),
                           lines=nothing, solid=nothing)
    own, other = np.hypot(*(np.clip(at, centres[0] - sizes[0] / 2, centres[0] + sizes[0] / 2) - at).T)
    assert own < other


def test_a_distant_label_is_joined_to_its_marker_by_a_line(small: World) -> None:
    # A path around the only site, where a label beside it would begin: farther off there is room.
    angles = np.linspace(0, 2 * np.pi, 60)
    around = np.array([1.5, 1.5]) + 0.15 * np.column_stack([np.cos(angles), np.sin(angles)])
    alone = replace(small, sites=(replace(small.sites[0], x_m=1.5, y_m=1.5),), obstacles=Obstacles(
        bounds_m=small.obstacles.bounds_m, boxes=np.empty((0, 5)), cylinders=np.empty((0, 3))))
    assert b'id="leader-' not in draw_world(alone, "svg", Overlays())
    assert b'id="leader-base"' in draw_world(alone, "svg", Overlays(paths=(around,)))


def test_the_command_draws_a_plan_and_leaves_nothing_half_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    world, plan, picture = tmp_path / "w.yaml", tmp_path / "p.json", tmp_path / "w.svg"
    world.write_text(SMALL)
    plan.write_text(json.dumps({"format": "sva-bench/plan@1", "routes": {"uv1": ["base", "p1", "r1", "base"]}}))
    arguments = ["world", "draw", str(world), "-o", str(picture), "--plan", str(plan), "--roadmap", "--paths"]
    assert run_command_line(arguments) == 0
    assert picture.read_bytes().startswith(b"<?xml")
    picture.unlink()
    plan.write_text(json.dumps({"format": "sva-bench/plan@1", "routes": {"uv1": ["base", "p9", "base"]}}))
    assert run_command_line(arguments) == 2
    assert "there is no site 'p9'" in " ".join(capsys.readouterr().err.split())
    assert run_command_line(["world", "draw", str(world), "-o", str(tmp_path / "w.jpg")]) == 2
    assert "let the name end in .png or .svg" in " ".join(capsys.readouterr().err.split())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["p.json", "w.yaml"]


@pytest.mark.parametrize("interaction", ["independent", "shared"])
def test_paths_are_drawn_of_all_robots_from_their_own_berths(
        interaction: Interaction, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "w.yaml").write_text(SMALL)
    shown: list[Overlays] = []

    def watched(world: World, kind: Kind, overlays: Overlays) -> bytes:
        shown.append(overlays)
        return draw_world(world, kind, overlays)

    monkeypatch.setattr(pictures, "draw_world", watched)
    assert run_command_line(["world", "draw", str(tmp_path / "w.yaml"), "--interaction", interaction, "--paths",
                             "--roadmap", "-o", str(tmp_path / "w.svg")]) == 0
    world = replace(world_of(tmp_path), interaction=interaction)
    starts = place_berths(world) if world.meets else [(world.sites[0].x_m, world.sites[0].y_m)]
    assert {tuple(np.round(path[0], 6)) for path in shown[0].paths} >= {tuple(np.round(start, 6)) for start in starts}
    assert len(shown[0].paths) == len(starts) * len(list(combinations(world.sites, 2)))
    assert (shown[0].paths_of, shown[0].roadmap_of) == (("uv1 and uv2", "uv1") if world.meets else ("", ""))


@pytest.mark.parametrize("longest", [4, 30, 90])
@pytest.mark.parametrize("plans", [2, 4, 8])
def test_a_legend_keeps_within_its_chart_however_long_names_are(longest: int, plans: int) -> None:
    figure = Figure(figsize=(4.8, 4.0), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for number in range(plans):
        axes.plot([0, 1], [number, number], label=f"{number} " + "plan-of mine "[:longest] * (longest // 13 + 1))
    charts._legend(axes)
    figure.draw_without_rendering()
    legend = axes.get_legend()
    assert legend is not None
    assert legend.get_window_extent().x1 <= figure.bbox.x1


def test_names_of_passages_and_sites_keep_off_each_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # The first passage has the base in its middle, the second a POI.
    world = world_of(tmp_path, SMALL + "passages:\n  door: {at_m: [[0.3, 0.3], [1.3, 1.3]], blocked: 0.1, wait_s: 1}\n"
                     "  side: {at_m: [[4.2, 0.0], [4.2, 1.6]], blocked: 0.1, wait_s: 1}\n")
    found: list[FloatArray] = []

    def placed(at: FloatArray, sizes: FloatArray, **others: FloatArray) -> FloatArray:
        centres = place_labels(at, sizes, **others)
        found.append(np.concatenate([centres - sizes / 2, centres + sizes / 2], axis=1))
        return centres

    monkeypatch.setattr(drawing, "place_labels", placed)
    draw_world(world, "svg", Overlays())
    (boxes,) = found
    assert len(boxes) == len(world.sites) + len(world.passages)
    for one, other in combinations(boxes, 2):
        assert (np.minimum(one[2:], other[2:]) <= np.maximum(one[:2], other[:2])).any()
