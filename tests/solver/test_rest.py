"""The rest of a mission planned, against enumeration of all orders from where the robots are."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from sva_bench.choices import FailureProcess
from sva_bench.mission.instance import Instance
from sva_bench.mission.rest import Afield, Rest
from sva_bench.solver.rest import plan_rest
from tests.oracles.rest import Ground, Here, TooMany
from tests.oracles.teams import random_team
from tests.solver.oracle import random_instance

SOLVED = 1e-6  # the gap at which a solve ends

# The solver plans for neither lifetimes nor the cost of a loss.
over_solved = pytest.mark.parametrize("process", ["mission", "per_leg", "hazard"])


def random_rest(seed: int, process: FailureProcess) -> Rest:
    """Robots anywhere, some with too little fuel or time to come home; every other seed without a metric."""
    rng = np.random.default_rng([seed, 11])
    instance = random_team(seed, process, losses=True) if seed % 2 else \
        replace(random_instance(seed), failure=process)
    names = instance.sites
    vehicles, taken = [], set()
    for vehicle in instance.vehicles:
        if rng.random() < 0.1:
            continue  # dead, or home
        site = int(rng.integers(len(names)))
        if site in instance.pois:
            taken.add(names[site])
        filled = site == instance.base or site in instance.stations
        tank = min(vehicle.fuel_capacity_s, 40.0)
        ready = float(rng.integers(0, int(vehicle.mission_limit_s * rng.choice([0.3, 0.6, 1.2])) + 1))
        vehicles.append(Afield(
            name=vehicle.name, site=names[site], ready_s=ready, burnt_s=0.0 if filled else float(
                rng.integers(0, int(tank * rng.choice([0.5, 1.0])) + 1)),
            availability=float(rng.choice([0.4, 1.0])) if process == "mission" else vehicle.availability,
            orders=(*(names[j] for j in rng.permutation(len(names))[:3] if j not in (site, instance.base)),
                    names[instance.base])))
    open_pois = frozenset(names[j] for j in instance.pois if rng.random() < 0.8) - taken
    return Rest(instance=instance, vehicles=tuple(vehicles), open_pois=open_pois)


def here_of(instance: Instance, vehicle: Afield) -> Here:
    """A robot as the oracle has it."""
    robot = [v.name for v in instance.vehicles].index(vehicle.name)
    alive = vehicle.availability if instance.failure == "mission" else 1.0
    return Here(robot, instance.sites.index(vehicle.site), vehicle.ready_s, vehicle.burnt_s, alive)


def check(rest: Rest) -> Counter[str]:
    """The plan keeps every rule and is worth as much as the best; what there was to see."""
    ground, sites = Ground(rest.instance), list(rest.instance.sites)
    given = plan_rest(rest)
    assert list(given) == [v.name for v in rest.vehicles]
    assert plan_rest(rest) == given
    here = {v.name: here_of(rest.instance, v) for v in rest.vehicles}
    safe = [v.name for v in rest.vehicles if ground.is_safe(*here[v.name][:4])]
    assert [name for name, orders in given.items() if orders is not None] == safe
    kept = {site for v in rest.vehicles if v.name not in safe for site in v.orders}
    visits = [site for name in safe for site in given[name] or () if sites.index(site) in ground.bit]
    assert set(visits) <= rest.open_pois - kept
    assert len(visits) == len(set(visits))
    for name in safe:
        orders = given[name]
        assert (orders or ("",))[-1] in ("", sites[ground.base])
        assert bool(orders) or here[name].site == ground.base
    value = sum(ground.of_orders(here[name], tuple(sites.index(s) for s in given[name] or ())) for name in safe)
    free = sum(ground.bit[sites.index(p)] for p in rest.open_pois - kept)
    best, _ = ground.best_of_rest([here[name] for name in safe], free)
    assert value == pytest.approx(best, rel=SOLVED, abs=SOLVED)
    return Counter(unsafe=len(safe) < len(given), several=len(safe) > 1, visits=bool(visits),
                   afield=any(here[name].site in ground.bit for name in safe),
                   station=any(here[name].site in ground.stations for name in safe),
                   home=any(here[name].site == ground.base for name in safe),
                   burnt=any(here[name].burnt > 0 for name in safe), kept=bool(kept & rest.open_pois))


@pytest.mark.spread(80)
@over_solved
@pytest.mark.parametrize("seed", range(120))
def test_the_rest_is_planned_as_well_as_enumeration_does(seed: int, process: FailureProcess) -> None:
    check(random_rest(seed, process))


@pytest.mark.long
@over_solved
@pytest.mark.parametrize("seed", range(1000, 4000))
def test_the_rest_is_planned_as_well_as_enumeration_does_on_many_teams(seed: int, process: FailureProcess) -> None:
    try:
        check(random_rest(seed, process))
    except TooMany:  # two seeds in three thousand
        pytest.skip("more states than enumeration goes through")


def test_random_rests_have_what_makes_them_hard() -> None:
    found = sum((check(random_rest(seed, "per_leg")) for seed in range(40)), Counter[str]())
    assert min(found[what] for what in (
        "unsafe", "several", "visits", "afield", "station", "home", "burnt", "kept")) >= 5, found
