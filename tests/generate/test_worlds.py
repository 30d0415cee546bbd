"""Random worlds as files: readable, solvable, and neither trivial nor hopeless."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from sva_bench.__main__ import run_command_line
from sva_bench.choices import WorldFamily
from sva_bench.errors import BadInput
from sva_bench.files.documents import parse_yaml
from sva_bench.generate.mission import SCENARIOS, propose_mission
from sva_bench.generate.terrain import random_places
from sva_bench.generate.worlds import random_world
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.mission.certify import expected_value
from sva_bench.mission.instance import Instance
from sva_bench.solver.routes.refuelling import quickest_route
from sva_bench.solver.two_stage import knowledge_of, plan_nominal
from sva_bench.study.costs import instance_of, plan_costs
from sva_bench.study.options import Options
from sva_bench.study.planning import plan_scenarios
from sva_bench.world.load import world_of
from sva_bench.world.model import Site, World
from tests.commands_for_tests import sva_bench

FAMILIES: tuple[WorldFamily, ...] = get_args(WorldFamily)


def text_of(family: WorldFamily, seed: int, *, size_m: float = 12, pois: int = 6, stations: int = 2, robots: int = 2,
            density: float | None = None) -> str:
    return random_world(family, size_m=size_m, density=density, pois=pois, stations=stations, robots=robots, seed=seed,
                        progress=lambda *_: None)


def resolved(text: str) -> World:
    return world_of(parse_yaml(text, Path("random.yaml")))


def check_that_it_is_a_good_mission(world: World) -> bool:
    """Every robot reaches every site, and no team collects everything; whether planning for failures pays."""
    costs = plan_costs(world, "prmstar", lambda *_: None)
    assert np.isfinite(next(iter(costs.values())).cost_s).all()
    instance = instance_of(world, costs, world.scenarios[0])
    assert all(earned > 0 for earned in collected_alone(instance))
    everything = sum(max(robot.incentives.get(poi.name, 0.0) for robot in world.robots) for poi in world.pois)
    nominal = plan_nominal(instance)
    assert nominal.status == "optimal"
    assert nominal.bound is not None
    assert 0.3 * everything < nominal.bound < everything
    planned = plan_scenarios(world, costs, Options(), lambda *_: None)
    vss = {name: expected_value(p.instance, p.stochastic) - expected_value(p.instance, p.deterministic)
           for name, p in planned.items()}
    assert vss["S1"] == pytest.approx(0, abs=1e-6)
    return max(vss["S3"], vss["S4"]) > 0


def collected_alone(instance: Instance) -> list[float]:
    """The most that each robot can collect at a single POI."""
    legs_by_vehicle = knowledge_of(instance).legs_by_vehicle
    return [max(vehicle.incentives[poi] if quickest_route(own_legs, (poi,)) else 0.0 for poi in instance.pois)
            for vehicle, own_legs in zip(instance.vehicles, legs_by_vehicle, strict=True)]


def test_a_random_world_is_a_good_mission_with_the_papers_scenarios() -> None:
    world = resolved(text_of("rooms", 1))
    assert check_that_it_is_a_good_mission(world)
    assert [site.name for site in world.sites] == ["base", "r1", "r2", *(f"p{k}" for k in range(1, 7))]
    assert {s.name: s.availability for s in world.scenarios} == {
        name: {"uv1": 1.0, "uv2": share} for name, share in SCENARIOS.items()}
    assert len(world.robots[0].incentives) == 3  # the certain robot earns nothing at half of the POIs
    assert set(world.robots[1].incentives) == {poi.name for poi in world.pois}


def test_equal_arguments_give_equal_bytes_with_the_command_in_a_comment() -> None:
    text = text_of("field", 3)
    assert text == text_of("field", 3)
    lines = text.splitlines()
    assert "world random --family field --size 12" in lines[0]
    assert "--seed 3" in lines[1]
    assert max(map(len, lines)) <= 120
    assert text.count("\n\n") == 5  # an empty line between the sections, as in the shipped worlds


def line_of_sites(pois: int, stations: int = 1) -> tuple[list[Site], np.ndarray]:
    """Sites every 10 s along a line: base, stations, POIs."""
    kinds = ["base", *["station"] * stations, *["poi"] * pois]
    sites = [Site(name=f"s{k}", kind=kind, x_m=float(k), y_m=0.0, heading_rad=0.0)  # type: ignore[arg-type]
             for k, kind in enumerate(kinds)]
    at = np.arange(len(sites)) * 10.0
    return sites, np.abs(at[:, None] - at[None])


def test_limits_let_a_team_collect_much_but_not_all() -> None:
    sites, fuel = line_of_sites(8)
    mission = propose_mission(sites, fuel, robots=3, seed=0, key=())
    assert (mission.robots, mission.certain) == (("uv1", "uv2", "uv3"), 2)
    # The remotest POI is 90 s away: 180 s there and back would pass all others on the way.
    assert mission.mission_limit_s < 180
    assert mission.mission_limit_s >= 2 * 20  # the nearest POI, 20 s away
    assert mission.fuel_capacity_s <= mission.mission_limit_s
    assert mission.mission_limit_s % 5 == 0
    assert [len(earned) for earned in mission.incentives] == [4, 4, 8]
    assert all(1 <= value <= 170 for earned in mission.incentives for value in earned.values())


def test_the_fuel_capacity_suffices_for_the_remotest_poi() -> None:
    sites, fuel = line_of_sites(8, stations=0)
    fuel = fuel / 10 + 100 * (fuel > 0)  # about 100 s between any two: half the limit would not do
    mission = propose_mission(sites, fuel, robots=2, seed=0, key=())
    assert mission.fuel_capacity_s >= 200
    assert math.isfinite(mission.mission_limit_s)


@pytest.mark.parametrize(("pois", "robots"), [(8, 1), (3, 2), (7, 4)])
def test_too_few_robots_or_pois_leave_nothing_to_decide(pois: int, robots: int) -> None:
    sites, fuel = line_of_sites(pois)
    with pytest.raises(BadInput, match=f"{robots} robots? and {pois} POIs leave nothing to decide"):
        propose_mission(sites, fuel, robots=robots, seed=0, key=())


def test_the_command_writes_a_file_that_check_calls_good(tmp_path: Path) -> None:
    done = sva_bench("world", "random", "--family", "maze", "--size", 12, "--pois", 5, "--stations", 2, "--seed", 7,
                     "-o", "maze.yaml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    checked = sva_bench("world", "check", "maze.yaml", cwd=tmp_path)
    assert checked.returncode == 0, checked.stderr
    assert "maze-12m-k2-n5-m2-s7 is a good world: 2 stations, 5 POIs, 2 robots, 4 scenarios" in checked.stdout
    world = (tmp_path / "maze.yaml").read_text(encoding="utf-8")
    (tmp_path / "dry.yaml").write_text(re.sub(r"fuel_capacity_s: [0-9.]+", "fuel_capacity_s: 0.5", world))
    checked = sva_bench("world", "check", "dry.yaml", cwd=tmp_path)
    assert checked.returncode == 0, checked.stderr
    assert "good world" not in checked.stdout
    assert "no robot reaches any POI" in " ".join(checked.stdout.split())


@pytest.mark.parametrize(("arguments", "said"), [
    (("--family", "field", "--density", "0.9"), "a density of 0.9 does not fit a field of 10 m"),
    (("--pois", "90"), "do not fit: there is room for"),
    (("--pois", "4", "--robots", "3"), "3 robots and 4 POIs leave nothing to decide"),
    (("--density", "nan"), "'--density'"), (("--size", "5"), "'--size'"), (("--family", "swamp"), "swamp"),
])
def test_what_does_not_fit_gives_one_clear_message_and_no_file(
    arguments: tuple[str, ...], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    size = () if "--size" in arguments else ("--size", "10")
    assert run_command_line(["world", "random", *size, *arguments, "-o", str(tmp_path / "w.yaml")]) == 2
    printed = capsys.readouterr()
    assert said in " ".join(printed.err.split())
    assert printed.out == ""
    assert not list(tmp_path.iterdir())


@pytest.mark.long
@pytest.mark.parametrize("family", FAMILIES)
def test_random_worlds_of_all_families_are_good_missions(family: WorldFamily) -> None:
    # Of a few POIs the best plan may be the best whoever is available; of eight worlds at most one is like that.
    pays = []
    for seed in range(8):
        size, pois, stations, robots = [(10, 6, 2, 2), (18, 10, 5, 2), (14, 8, 0, 3), (30, 12, 5, 3)][seed % 4]
        world = resolved(text_of(family, seed, size_m=size, pois=pois, stations=stations, robots=robots))
        pays.append(check_that_it_is_a_good_mission(world))
    assert sum(pays) >= len(pays) - 1


@pytest.mark.long
@pytest.mark.parametrize("family", FAMILIES)
def test_random_worlds_run(family: WorldFamily, tmp_path: Path) -> None:
    (tmp_path / "w.yaml").write_text(text_of(family, 5))
    done = sva_bench("run", "w.yaml", "--fidelity", "kinematic", "--trials", 100, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr


def earned(text: str) -> np.ndarray:
    """What each robot of a world earns at each POI, shape (robots, POIs)."""
    world = resolved(text)
    return np.array([[robot.incentives.get(poi.name, 0.0) for poi in world.pois] for robot in world.robots])


@pytest.mark.long
def test_worlds_of_one_seed_are_independent_samples() -> None:
    # Families, sizes, densities and numbers of sites that used to draw the very same incentives from a seed.
    texts = [text_of(family, 5) for family in FAMILIES]
    texts += [text_of("field", 5, size_m=14), text_of("field", 5, density=0.06), text_of("field", 5, stations=1)]
    drawn = [earned(text) for text in texts]
    assert len({values[1].tobytes() for values in drawn}) == len(drawn)
    assert len({values[0].tobytes() for values in drawn}) == len(drawn)
    # 21 pairs of six uniforms each: their correlation is 0, its standard deviation 1 / sqrt(21 x 5) = 0.1.
    pairs = [np.corrcoef(a[1], b[1])[0, 1] for k, a in enumerate(drawn) for b in drawn[:k]]
    assert abs(np.mean(pairs)) < 0.4


def test_the_same_room_with_another_post_draws_other_sites() -> None:
    def ground(x: float) -> Obstacles:
        return Obstacles(bounds_m=np.array([0.0, 0, 12, 12]), boxes=np.empty((0, 5)),
                         cylinders=np.array([[x, 6.0, 0.2]]))

    one, again, other = (random_places(ground(x), stations=2, pois=6, seed=0) for x in (6.0, 6.0, 6.1))
    assert one == again
    assert not set(one.pois) & set(other.pois)


def test_missions_for_the_same_sites_on_other_ground_earn_otherwise() -> None:
    sites, fuel = line_of_sites(8)
    one, again, other = (propose_mission(sites, fuel, robots=3, seed=0, key=key) for key in ((1, 2), (1, 2), (1, 3)))
    assert one.incentives == again.incentives
    assert all(a != b for a, b in zip(one.incentives, other.incentives, strict=True))
