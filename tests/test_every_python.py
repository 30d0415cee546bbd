"""The same world, seed and version give the same plans, rows and drives on every Python and with all its libraries.

What stands here was written by Python 3.11. Whatever changes it changes what users get: say so in CHANGELOG.md.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from sva_bench.__main__ import run_command_line
from sva_bench.execution.driving import drive_route
from sva_bench.robot.model import BUILT_IN
from tests.execution.test_simulator import random_tour
from tests.worlds_for_tests import SMALL

SURE = {"uv1": ["base", "p4", "p3", "base"], "uv2": ["base", "p1", "p2", "base"]}
ROUTES = {
    "half-stochastic": {"uv1": ["base", "p2", "p3", "p4", "base"], "uv2": ["base", "p1", "base"]},
    "half-deterministic": SURE, "safe-stochastic": SURE, "safe-deterministic": SURE,
}
COLUMNS = {
    "travel_times": {
        "origin": "08284adff50e", "destination": "42e2619750ce", "model": "a4d5d4780831", "raw_s": "320d26d63e8e",
        "repaired_s": "320d26d63e8e", "via": "42e2619750ce"},
    "outcomes": {
        "scenario": "82a9d95a66f4", "planner": "71ff4b4b22ca", "trial": "ac7cbb35791d", "rollout": "3da3058e23b4",
        "robot": "2c20deae8ef0", "available": "4cd08a814a67", "incentive": "3291f21fb9eb",
        "pois_reached": "693240f6d26c", "stops_reached": "21fc1ebe1349", "end": "3fa3f34f4c5b",
        "end_time_s": "c22993b71f64", "fuel_used_s": "2476f38eebf5", "lost": "8f8d96e13973", "value": "3291f21fb9eb",
        "policy": "6583bce6148f", "news": "3df978043c5e", "waited_s": "2d4f631f7ac1", "contacts": "e2236e604753"},
}


def digest(values: list[Any]) -> str:
    """Of a column's values, whatever file they stand in; floats as far as processors agree upon sines."""
    plain = [round(value, 6) if isinstance(value, float) else value for value in values]
    return hashlib.sha256(json.dumps(plain).encode()).hexdigest()[:12]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run of the small world."""
    place = tmp_path_factory.mktemp("every")
    (place / "small.yaml").write_text(SMALL, encoding="utf-8")
    run_command_line(["run", str(place / "small.yaml"), "--fidelity", "kinematic", "--trials", "60", "--rollouts", "3",
                      "--workers", "1", "--out", str(place / "runs")])
    (made,) = (place / "runs").iterdir()
    return made


def test_plans_are_those_of_every_other_python(folder: Path) -> None:
    routes = {path.stem: json.loads(path.read_text(encoding="utf-8"))["routes"]
              for path in sorted((folder / "plans").glob("*.json"))}
    assert routes == ROUTES


@pytest.mark.parametrize("table", ["travel_times", "outcomes"])
def test_rows_are_those_of_every_other_python(table: str, folder: Path) -> None:
    read = pq.read_table(folder / f"{table}.parquet")
    assert {name: digest(read[name].to_pylist()) for name in COLUMNS[table]} == COLUMNS[table]


# Leg times [s], which are counted in steps, and the last pose [m, m, rad].
DRIVES = {
    ("turtlebot2", 4): ([542 / 60, 856 / 60, 554 / 60, 748 / 60], [2.3776952881, 0.7420446181, 0.7061962646]),
    ("turtlebot2", 9): ([749 / 60, 595 / 60, 626 / 60, 440 / 60], [2.7245088882, 5.5219178307, -0.1122346162]),
    ("turtlebot3_burger", 1): ([468 / 60, 1132 / 60, 633 / 60, 753 / 60], [7.0989902664, 2.6601253815, 2.097229638]),
    ("turtlebot3_waffle", 2): ([465 / 60, 768 / 60, 1853 / 60, 1447 / 60], [3.4349797093, 3.5058461064, -2.7076054723]),
}


@pytest.mark.parametrize(("model", "seed"), sorted(DRIVES))
def test_drives_in_physics_are_those_of_every_other_python(model: str, seed: int) -> None:
    driven = drive_route(random_tour(seed, 5, BUILT_IN[model]))
    legs, pose = DRIVES[model, seed]
    assert driven.leg_s.tolist() == pytest.approx(legs, abs=1e-9)
    assert driven.pose[-1].tolist() == pytest.approx(pose, abs=1e-6)
