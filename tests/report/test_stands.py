"""Berths and slots: where robots stand, in pictures and in words."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sva_bench.report.drawing import draw_world
from sva_bench.report.overlays import Overlays
from sva_bench.report.stands import Stand, interaction_lines, stands_of
from sva_bench.travel.berths import place_berths
from tests.worlds_for_tests import SMALL, world_of

SHARED = SMALL.replace("stop_s: 4}", "stop_s: 4, slots: 2}") + "interaction: shared\n"


def test_each_robot_has_a_berth_and_stations_the_slots_that_are_used(tmp_path: Path) -> None:
    world = world_of(tmp_path, SHARED)
    stands = stands_of(world)
    assert [(stand.kind, stand.name) for stand in stands] == [
        ("berth", "uv1"), ("berth", "uv2"), ("slot", "r1"), ("slot", "r1")]
    assert [(stand.x_m, stand.y_m) for stand in stands[:2]] == list(place_berths(world))
    radius = world.robots[0].model.radius_m
    for k, one in enumerate(stands):  # none stands in another
        assert one.radius_m == radius
        for other in stands[:k]:
            assert np.hypot(one.x_m - other.x_m, one.y_m - other.y_m) > 2 * radius


def test_nobody_has_a_berth_where_nobody_meets(tmp_path: Path) -> None:
    world = world_of(tmp_path, SHARED)
    assert stands_of(replace(world, interaction="independent")) == ()
    alone = replace(world, robots=world.robots[:1])
    assert stands_of(alone) == ()
    assert interaction_lines(alone, ())[0] == "interaction shared: there is one robot, which meets nobody"
    assert interaction_lines(world_of(tmp_path), ()) == []


@pytest.mark.parametrize(("stations", "said"), [
    ({}, "each station serves one robot at a time"),
    ({"r1": 3}, "robots that stations serve at a time, by their slots: r1 3; the others serve one"),
    ({"r1": 3, "r2": 2}, "robots that stations serve at a time, by their slots: r1 3, r2 2; the other serves one"),
    ({"r1": 3, "r2": 2, "r3": 4}, "robots that stations serve at a time, by their slots: r1 3, r2 2, r3 4")])
def test_a_check_says_how_many_robots_each_station_serves(
        stations: dict[str, int], said: str, tmp_path: Path) -> None:
    world = world_of(tmp_path, SHARED)
    base, station, *pois = world.sites
    world = replace(world, sites=(base, *(replace(station, name=name, slots=stations.get(name, 1))
                                          for name in ("r1", "r2", "r3")), *pois))
    assert interaction_lines(world, ())[-1] == said


def test_without_coordination_no_station_is_said_to_queue(tmp_path: Path) -> None:
    world = replace(world_of(tmp_path, SHARED), interaction="uncoordinated")
    (line,) = interaction_lines(world, stands_of(world))
    assert line.startswith("interaction uncoordinated: 2 berths")


def test_a_picture_shows_them_and_is_as_before_without(tmp_path: Path) -> None:
    world = world_of(tmp_path, SHARED.replace(", slots: 2", ""))
    plain = draw_world(replace(world, interaction="independent"), "svg", Overlays())
    assert draw_world(world, "svg", Overlays()) == plain
    drawn = draw_world(world, "svg", Overlays(stands=stands_of(world))).decode()
    assert "<!-- berth of a robot -->" in drawn
    assert "slot of a station" not in drawn
    assert drawn.count("stroke-dasharray") == plain.decode().count("stroke-dasharray") + 2  # a ring for each
    busy = world_of(tmp_path, SHARED)
    several = draw_world(busy, "svg", Overlays(stands=stands_of(busy))).decode()
    assert "<!-- slot of a station -->" in several
    assert several.count("stroke-dasharray") == drawn.count("stroke-dasharray") + 2


@pytest.mark.parametrize("radius_m", [0.1, 0.5])
def test_its_outline_is_where_labels_do_not_go(radius_m: float) -> None:
    away = np.hypot(*(Stand(kind="berth", name="uv1", x_m=3.0, y_m=-2.0, radius_m=radius_m).outline(16)
                      - np.array([3.0, -2.0])).T)
    assert away.max() == pytest.approx(radius_m)
    assert away.min() == pytest.approx(radius_m / 2)
    assert away.shape == (32,)
