"""Random instances of the paper's kind."""

from __future__ import annotations

import numpy as np

from sva_bench.choices import InstanceFamily
from sva_bench.mission.instance import Instance, Vehicle

SIDE = 100.0
STATIONS = ((25.0, 25.0), (25.0, 75.0), (75.0, 25.0), (75.0, 75.0))
DECIMALS = 9
MOST_INCENTIVE = (150.0, 170.0)
_STREAMS = {"places": 0, "incentives": 1, "winds": 2}

FUEL_MULTIPLE: dict[InstanceFamily, float] = {"A": 2.25, "B": 1.0, "C": 1.2}
"""Fuel capacity in largest distances; the paper's table has 2.25 to 3."""

FUEL_TIGHT_LIMIT = 2.25
"""Mission limit of family B in largest distances."""


def random_instance(
    family: InstanceFamily, *, pois: int, vehicles: int, availability: float, seed: int,
    fuel_multiple: float | None = None, tau: float | None = None, directed: bool = False,
) -> Instance:
    """A random instance: base in the middle of a square of side 100, four stations, POIs anywhere.

    Every other vehicle is certain and earns up to 150 at half of the POIs; the others are uncertain and earn up to 170
    at all of them. The paper leaves the mission limit open; the families close that gap in three ways: **A**, where
    one filling lasts for the whole mission, **B**, where a mission takes two to five refuels, and **C**, where routes
    are short.

    Args:
        family: The family.
        pois: Number of POIs.
        vehicles: Number of vehicles.
        availability: Availability of the uncertain vehicles.
        seed: Seed; places and incentives depend on nothing else but the numbers of POIs and vehicles.
        fuel_multiple: Fuel capacity in largest distances; default: the family's.
        tau: Mission limit in fuel capacities; default: 1, and in family B what makes it 2.25 largest distances.
        directed: Whether a leg costs up to a tenth more, by chance, each way.

    Source:
        Section 5.1 of the paper.
    """
    multiple = FUEL_MULTIPLE[family] if fuel_multiple is None else fuel_multiple
    if min(pois, vehicles) < 0 or not 0 <= availability <= 1 or multiple <= 0 or (tau is not None and tau <= 0):
        raise ValueError("numbers and limits can't be negative, and an availability is a probability")
    places, incomes, winds = (np.random.default_rng((seed, stream)) for stream in _STREAMS.values())
    at = np.concatenate([[(SIDE / 2, SIDE / 2)], STATIONS, places.uniform(0, SIDE, size=(pois, 2))])
    fuel = np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1))
    if directed:
        fuel = fuel * (1 + 0.1 * winds.random(fuel.shape))
        for k in range(len(fuel)):
            fuel = np.minimum(fuel, fuel[:, k, None] + fuel[None, k, :])
    fuel = np.ceil(fuel * 10**DECIMALS) / 10**DECIMALS
    longest = float(fuel.max())
    capacity = multiple * longest
    limit = FUEL_TIGHT_LIMIT * longest if family == "B" and tau is None else (tau or 1.0) * capacity
    first = 1 + len(STATIONS)
    team = []
    for m in range(vehicles):
        certain = m % 2 == 0
        earned = incomes.uniform(0, MOST_INCENTIVE[m % 2], size=pois)
        if certain:
            earned[incomes.permutation(pois)[:pois // 2]] = 0.0
        team.append(Vehicle(
            name=f"uv{m + 1}", fuel_capacity_s=capacity, mission_limit_s=limit,
            availability=1.0 if certain else availability, incentives=np.concatenate([np.zeros(first), earned]),
            fuel_s=fuel))
    name = f"{family}-n{pois}-m{vehicles}-p{100 * availability:g}-s{seed}{'-directed' if directed else ''}"
    sites = ("base", *(f"r{k}" for k in range(1, first)), *(f"p{k}" for k in range(1, pois + 1)))
    return Instance(name=name, sites=sites, base=0, stations=tuple(range(1, first)), stop_s=np.zeros(len(sites)),
                    vehicles=tuple(team))
