"""What ships with the bench: every world loads and says what it should, every plan fits its world."""

from __future__ import annotations

from pathlib import Path

import pytest

from sva_bench.mission.certify import certify
from sva_bench.mission.plan_file import read_plan
from sva_bench.study.costs import instance_of, nominal_scenario, plan_costs
from sva_bench.world.load import load_world

ROOT = Path(__file__).parents[1]


OF_THE_TUTORIAL = "three-halls"


def test_the_world_of_the_tutorial_is_there_beside_those_of_the_paper() -> None:
    names = {path.stem for path in (ROOT / "worlds").glob("*.yaml")}
    assert names == {"four-rooms", "maze", "open-field", "three-robots", "warehouse", OF_THE_TUTORIAL}


@pytest.mark.parametrize("path", sorted(path for path in (ROOT / "worlds").glob("*.yaml")
                                        if path.stem != OF_THE_TUTORIAL), ids=lambda path: path.stem)
def test_a_shipped_world_has_what_the_paper_has(path: Path) -> None:
    world = load_world(path)
    assert world.name == path.stem
    assert len(world.stations) == 5
    assert 15 <= len(world.pois) <= 20
    assert [s.name for s in world.scenarios] == ["S1", "S2", "S3", "S4"]
    unreliable = world.robots[-1].name
    assert [s.availability[unreliable] for s in world.scenarios] == [1.0, 0.75, 0.25, 0.0]
    totals = {robot.name: sum(robot.incentives.values()) for robot in world.robots}
    assert totals[unreliable] == max(totals.values())  # the unreliable one earns more


@pytest.mark.parametrize("path", sorted((ROOT / "plans").glob("*.json")), ids=lambda path: path.stem)
def test_a_shipped_plan_is_feasible_in_its_world(path: Path) -> None:
    world_path = max((w for w in (ROOT / "worlds").glob("*.yaml") if path.stem.startswith(w.stem)),
                     key=lambda w: len(w.stem))
    world = load_world(world_path)
    instance = instance_of(world, plan_costs(world, "prmstar", lambda *_: None), nominal_scenario(world))
    certificate = certify(instance, read_plan(path, instance))
    assert certificate.reasons == ()
    assert certificate.feasible
