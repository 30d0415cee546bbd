"""Every shipped world, run in physics: the pattern of the paper's section 5.2."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import pytest

from sva_bench.world.load import load_world
from tests.commands_for_tests import sva_bench
from tests.test_shipped import OF_THE_TUTORIAL

WORLDS = sorted(path for path in (Path(__file__).parents[1] / "worlds").glob("*.yaml") if path.stem != OF_THE_TUTORIAL)


@pytest.mark.long
@pytest.mark.parametrize("path", WORLDS, ids=lambda path: path.stem)
def test_incentive_moves_to_the_reliable_robots_and_the_stochastic_plan_pays(path: Path, tmp_path: Path) -> None:
    done = sva_bench("run", path, "--trials", 1000, "--rollouts", 8, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["reproducible"]  # every plan proved
    scenarios = {s["name"]: s for s in summary["scenarios"]}
    unreliable = list(scenarios["S1"]["availability"])[-1]
    earned = [scenarios[name]["plans"]["stochastic"]["by_robot"] for name in ("S1", "S2", "S3", "S4")]
    # From S1 to S4 the reliable robots earn more and more, the unreliable one less and less.
    reliable = [sum(value for robot, value in by.items() if robot != unreliable) for by in earned]
    assert reliable[3] > reliable[0]
    # 3 %: noise now and then lets a robot run dry, in one scenario more often than in another.
    assert all(later >= 0.97 * earlier for earlier, later in pairwise(reliable))
    assert earned[3][unreliable] == 0 < earned[0][unreliable]
    assert scenarios["S1"]["vss"]["executed"] == {"mean": 0.0, "ci95": [0.0, 0.0]}
    for name in ("S3", "S4"):
        assert scenarios[name]["vss"]["distinguishable"]
        assert scenarios[name]["vss"]["executed"]["mean"] > 0
    routes = [json.loads(plan.read_text())["routes"] for plan in tmp_path.glob("runs/*/plans/*-stochastic.json")]
    assert any(site.startswith("r") for route in routes for stops in route.values() for site in stops)
    (run,) = (tmp_path / "runs").iterdir()
    first = json.loads((run / "plans" / "S1-stochastic.json").read_text())["routes"]
    visited = {site for stops in first.values() for site in stops if site.startswith("p")}
    assert len(visited) < len(load_world(path).pois)  # limits leave POIs out
