from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import pytest

from sva_bench.robot.model import BUILT_IN
from sva_bench.travel.fuel import FuelCosts, fuel_costs
from sva_bench.travel.times import plan_travel_times
from sva_bench.world.model import World
from tests.worlds_for_tests import world_of


@dataclass(frozen=True, eq=False, kw_only=True)
class Planned:
    """A world with its fuel costs."""

    world: World
    costs: Mapping[str, FuelCosts]


@pytest.fixture(scope="session")
def small(tmp_path_factory: pytest.TempPathFactory) -> Planned:
    """The small world, its paths planned once."""
    world = world_of(tmp_path_factory.mktemp("small"))
    model = BUILT_IN["turtlebot2"]
    return Planned(world=world, costs={model.name: fuel_costs(plan_travel_times(world, model), world.margin)})
