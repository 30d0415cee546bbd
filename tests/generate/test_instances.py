"""Random instances of the paper's kind."""

from __future__ import annotations

import numpy as np
import pytest

from sva_bench.choices import InstanceFamily
from sva_bench.generate.instances import random_instance
from sva_bench.mission.instance_file import instance_as_dict
from sva_bench.solver.preprocess import is_metric


@pytest.mark.parametrize("family", ["A", "B", "C"])
@pytest.mark.parametrize("directed", [False, True])
def test_an_instance_is_the_same_each_time_and_metric(family: InstanceFamily, directed: bool) -> None:
    one, other = (random_instance(family, pois=12, vehicles=3, availability=0.5, seed=4, directed=directed)
                  for _ in range(2))
    assert instance_as_dict(one) == instance_as_dict(other)
    fuel = one.vehicles[0].fuel_s
    assert is_metric(fuel, one.base)
    assert np.array_equal(fuel, fuel.T) != directed


def test_every_other_vehicle_is_certain_and_earns_nothing_at_half_of_the_pois() -> None:
    instance = random_instance("A", pois=20, vehicles=3, availability=0.25, seed=1)
    assert [v.availability for v in instance.vehicles] == [1.0, 0.25, 1.0]
    assert [int((v.incentives > 0).sum()) for v in instance.vehicles] == [10, 20, 10]
    assert all(v.incentives.max() <= most for v, most in zip(instance.vehicles, (150, 170, 150), strict=True))


def test_families_differ_in_what_their_fuel_allows() -> None:
    def ratios(family: InstanceFamily, fuel: float | None = None, tau: float | None = None) -> tuple[float, float]:
        instance = random_instance(family, pois=15, vehicles=2, availability=0.5, seed=2, fuel_multiple=fuel, tau=tau)
        vehicle = instance.vehicles[0]
        longest = float(vehicle.fuel_s.max())
        return round(vehicle.fuel_capacity_s / longest, 9), round(vehicle.mission_limit_s / longest, 9)

    assert ratios("A") == (2.25, 2.25)
    assert ratios("A", fuel=3.0, tau=1.25) == (3.0, 3.75)
    assert ratios("B") == (1.0, 2.25)
    assert ratios("B", fuel=0.8) == (0.8, 2.25)
    assert ratios("C") == (1.2, 1.2)


def test_the_second_vehicles_availability_changes_nothing_else() -> None:
    one, other = (random_instance("C", pois=9, vehicles=2, availability=p, seed=3) for p in (0.0, 1.0))
    assert np.array_equal(one.vehicles[1].incentives, other.vehicles[1].incentives)
    assert np.array_equal(one.vehicles[0].fuel_s, other.vehicles[0].fuel_s)


def test_what_makes_no_sense_is_refused() -> None:
    with pytest.raises(ValueError, match="probability"):
        random_instance("A", pois=5, vehicles=2, availability=1.5, seed=0)
