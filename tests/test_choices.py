"""Every word that users choose from: the registries behind it have the same words, and something uses each."""

from __future__ import annotations

import ast
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import pytest

from sva_bench import choices
from sva_bench.choices import Cuts, MapMode, Unknown
from sva_bench.execution.policies.registry import POLICIES
from sva_bench.generate import instances, terrain, worlds
from sva_bench.generate.instances import random_instance
from sva_bench.mission.failures import PROCESSES
from sva_bench.recording.colors import SITE_COLORS
from sva_bench.report import styles
from sva_bench.solver.methods import METHODS
from sva_bench.solver.two_stage import plan_stochastic
from sva_bench.travel.roadmap import PAIR_PLANNERS
from sva_bench.world.maps.ros import read_ros_map
from tests.world.maps_for_tests import write_ros_map

PACKAGE = Path(choices.__file__).parent
LITERALS: dict[str, tuple[str, ...]] = {
    name: get_args(value) for name, value in vars(choices).items() if get_origin(value) is Literal}

REGISTRIES: list[tuple[str, Iterable[Any]]] = [
    ("FailureProcess", PROCESSES),
    ("Method", ["auto", *METHODS]),
    ("Method", choices.METHODS),
    ("PathPlanner", ["prmstar", *PAIR_PLANNERS]),
    ("WorldFamily", terrain.DENSITY),
    ("WorldFamily", worlds._FIRST_WORDS),
    ("InstanceFamily", instances.FUEL_MULTIPLE),
    ("SiteKind", SITE_COLORS),
    ("SiteKind", styles.SITE_KINDS),
    ("SiteKind", styles.SITE_MARKERS),
    ("End", choices.ENDS),
    ("Interaction", choices.INTERACTIONS),
    ("Departures", choices.DEPARTURES),
    ("StandKind", styles.STANDS),
    ("PolicyName", POLICIES),
    ("PlanObjective", [*LITERALS["Objective"], *LITERALS["RiskKind"], "anticipative"]),
]


@pytest.mark.parametrize(("name", "registry"), REGISTRIES, ids=[name for name, _ in REGISTRIES])
def test_a_registry_has_the_words_that_users_choose_from(name: str, registry: Iterable[Any]) -> None:
    assert sorted(registry) == sorted(LITERALS[name])


def constants_of(path: Path) -> set[str]:
    return {node.value for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            if isinstance(node, ast.Constant) and isinstance(node.value, str)}


USED = {word for path in PACKAGE.rglob("*.py") if path.name != "choices.py" for word in constants_of(path)}


@pytest.mark.parametrize("name", LITERALS)
def test_each_word_is_there_for_something(name: str) -> None:
    assert LITERALS[name]
    # One of them may be what happens where none of the others is asked for.
    assert len(set(LITERALS[name]) - USED) <= 1


def literals_in(path: Path) -> Iterable[tuple[int, set[str]]]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Subscript) and getattr(node.value, "id", "") == "Literal":
            yield node.lineno, {n.value for n in ast.walk(node.slice)
                                if isinstance(n, ast.Constant) and isinstance(n.value, str)}


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_no_other_literal_lists_the_same_words(path: Path) -> None:
    if path.name == "choices.py":
        return
    for line, words in literals_in(path):
        for name, known in LITERALS.items():
            assert words != set(known), f"{path}:{line}: this is choices.{name}"


@pytest.mark.parametrize("cuts", get_args(Cuts))
def test_each_kind_of_optimality_cuts_proves_the_same_plan(cuts: Cuts) -> None:
    instance = random_instance("A", pois=5, vehicles=2, availability=0.75, seed=2)
    assert plan_stochastic(instance, method="lshaped", cuts=cuts).value == pytest.approx(
        plan_stochastic(instance).value, rel=1e-6)


@pytest.mark.parametrize("mode", get_args(MapMode))
@pytest.mark.parametrize("unknown", get_args(Unknown))
def test_each_mode_of_ros_maps_is_read(mode: MapMode, unknown: Unknown, tmp_path: Path) -> None:
    write_ros_map(tmp_path, "#.?\n...")
    path = tmp_path / "map.yaml"
    path.write_text(path.read_text() + f"mode: {mode}\n")
    if mode == "raw":  # levels of 0 to 100 are occupancies: 0 is free, 205 and 254 are unknown
        expected = [[unknown == "occupied"] * 3, [False, *[unknown == "occupied"] * 2]]
    elif mode == "scale":  # 205 is just above free_thresh: an occupancy of 0, once rounded
        expected = [[False] * 3, [True, False, False]]
    else:
        expected = [[False] * 3, [True, False, unknown == "occupied"]]
    cells, _ = read_ros_map(tmp_path, "map.yaml", unknown)
    assert cells.occupied.tolist() == expected
