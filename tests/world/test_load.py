"""World files: each complaint names line and key, and a resolved world is read back as itself."""

from __future__ import annotations

import json
import math
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from ruamel.yaml import YAML

from sva_bench.choices import NEWS, POLICY_NAMES
from sva_bench.errors import BadFile
from sva_bench.mission.failures import mtbf_s
from sva_bench.robot.model import BUILT_IN
from sva_bench.study.costs import instance_of, plan_costs
from sva_bench.world.load import draw_incentives, load_world, world_as_dict
from sva_bench.world.model import World, WorldReaction, nominal_of
from sva_bench.world.schema import Drawn, WorldFile
from tests.worlds_for_tests import SMALL, world_of

SHIPPED = sorted((Path(__file__).parents[2] / "worlds").glob("*.yaml"))


def complaint(folder: Path, text: str) -> BadFile:
    with pytest.raises(BadFile) as caught:
        world_of(folder, text)
    return caught.value


def line_of(text: str, piece: str) -> int:
    """Line of a piece of text that stands in it once, counted from 1."""
    assert text.count(piece) == 1, piece
    return text[: text.index(piece)].count("\n") + 1


def test_a_world_file_gives_its_world(tmp_path: Path) -> None:
    world = world_of(tmp_path)
    assert [site.name for site in world.sites] == ["base", "r1", "p1", "p2", "p3", "p4"]
    assert [site.kind for site in world.sites] == ["base", "station", "poi", "poi", "poi", "poi"]
    assert (world.sites[0].x_m, world.sites[0].y_m) == (0.8, 0.8)
    assert world.sites[0].heading_rad == pytest.approx(math.pi / 4)
    assert (world.sites[1].stop_s, world.sites[3].stop_s) == (4.0, 2.0)
    assert_array_equal(world.obstacles.bounds_m, [0, 0, 6, 6])
    # The box as written, half sizes and radians; the wall's centre, half length 1.3, half thickness, upright.
    assert_allclose(world.obstacles.boxes, [[3, 1.3, 1.3, 0.05, math.pi / 2],
                                            [2.2, 4.0, 0.6, 0.25, math.radians(30)]])
    assert_array_equal(world.obstacles.cylinders, [[4.4, 3.2, 0.3]])
    assert world.robots[1].availability == 0.75
    assert world.robots[0].model == BUILT_IN["turtlebot2"]
    assert [(s.name, dict(s.availability)) for s in world.scenarios] == [
        ("half", {"uv1": 1.0, "uv2": 0.5}), ("safe", {"uv1": 1.0, "uv2": 1.0})]
    assert (world.plan_failure, world.execute_failure, world.margin) == ("mission", "mission", 0.01)
    assert world.noisy
    assert [site.name for site in world.stations] == ["r1"]
    assert [site.name for site in world.pois] == ["p1", "p2", "p3", "p4"]
    assert world.scenario("safe") is world.scenarios[1]


@pytest.mark.parametrize(("old", "new", "key", "says"), [
    ("sites:\n", "sitse:\n", "sitse", "did you mean 'sites'"),
    ("fuel_capacity_s: 60\n    mission_limit_s: 120\n    incentives: {p1: 10,",
     "fuel_capacity: 60\n    mission_limit_s: 120\n    incentives: {p1: 10,", "robots.uv1.fuel_capacity",
     "did you mean 'fuel_capacity_s'"),
    ("{at_m: [2.2, 0.8]}", "{at: [2.2, 0.8]}", "sites.pois.p1.at", "did you mean 'at_m'"),
    ("noise: {wheel_gain_sd: 0.01}", "noise: {wheel_gain: 0.01}", "noise.wheel_gain", "did you mean 'wheel_gain_sd'"),
    ("name: small\n", "", "name", "is missing; add it"),
    ("base: {at_m: [0.8, 0.8], heading_deg: 45}", "base: {heading_deg: 45}", "sites.base.at_m", "is missing; add it"),
    ("name: small\n", "name: small\nname: other\n", "name", "is a duplicate"),
    ("p2: {at_m: [0.8, 5.0], stop_s: 2}", "p1: {at_m: [0.8, 5.0]}", "sites.pois.p1", "is a duplicate"),
    ("[2.2, 0.8]", "[.nan, 0.8]", "sites.pois.p1.at_m[0]", "finite"),
    ("[2.2, 0.8]", "[2.2, .inf]", "sites.pois.p1.at_m[1]", "finite"),
    ("[2.2, 0.8]", "[2.2]", "sites.pois.p1.at_m", "a point [x, y], found 1 entry"),
    ("[2.2, 0.8]", "[2.2, 0.8, 1]", "sites.pois.p1.at_m", "a point [x, y], found 3 entries"),
    ("[2.2, 0.8]", "[two, 0.8]", "sites.pois.p1.at_m[0]", "expected a number"),
    ("mission_limit_s: 120\n    incentives", "mission_limit_s: -1\n    incentives", "robots.uv1.mission_limit_s",
     "expected at least 0"),
    ("availability: 0.75", "availability: 1.5", "robots.uv2.availability", "expected at most 1"),
    ("half: {uv2: 0.5}", "half: {uv3: 0.5}", "scenarios.half.uv3", "there is no robot 'uv3'; did you mean"),
    ("half: {uv2: 0.5}", "half: {joint: [{probability: 0.5, available: [uv1]}, "
     "{probability: 0.4, available: []}]}", "scenarios.half.joint", "add up to 0.9, not to 1"),
    ("half: {uv2: 0.5}", "half: {joint: [{probability: 1, available: [uv9]}]}", "scenarios.half.joint[0].available[0]",
     "there is no robot 'uv9'"),
    ("[4.2, 0.8]", "[2.2, 4.0]", "sites.pois.p4.at_m", "inside an obstacle"),
    ("[4.2, 0.8]", "[4.4, 3.2]", "sites.pois.p4.at_m", "inside an obstacle"),
    ("[4.2, 0.8]", "[6.2, 0.8]", "sites.pois.p4.at_m", "'p4' is outside the bounds, 0 to 6 m and 0 to"),
    ("[4.2, 0.8]", "[0, 0.8]", "sites.pois.p4.at_m", "on the bounds, where the outer walls stand"),
    ("[4.2, 0.8]", "[5.9, 0.8]", "sites.pois.p4.at_m", "only 0.100 m from an outer wall"),
    ("[4.2, 0.8]", "[2.2, 0.8000001]", "sites.pois.p4", "'p4' and 'p1' are in one place"),
    ("p4: {at_m: [4.2, 0.8]}", "p4: {at_m: [4.2, 0.8]}\n    r1: {at_m: [4.2, 1.8]}", "sites.pois.r1",
     "another site named 'r1'"),
    ("p4: {at_m: [4.2, 0.8]}", "p4: {at_m: [4.2, 0.8]}\n    base: {at_m: [4.2, 1.8]}", "sites.pois.base",
     "another site named 'base'"),
    ("p4: {at_m: [4.2, 0.8]}", "'p 4': {at_m: [4.2, 0.8]}", None, "no valid name"),
    ("incentives: {p1: 10, p2: 20, p3: 30, p4: 40}", "incentives: {p1: 10, p5: 1}", "robots.uv1.incentives.p5",
     "there is no POI 'p5'; did you mean"),
    ("incentives: {p1: 10, p2: 20, p3: 30, p4: 40}", "incentives: {r1: 10}", "robots.uv1.incentives.r1",
     "there is no POI 'r1'"),
    ("model: turtlebot2\n    fuel_capacity_s: 60\n    mission_limit_s: 120\n    incentives",
     "model: turtlebot\n    fuel_capacity_s: 60\n    mission_limit_s: 120\n    incentives", "robots.uv1.model",
     "no built-in robot 'turtlebot'; did you mean 'turtlebot2'"),
    ("format: sva-bench/world@1", "format: sva-bench/world@2", "format", "expected 'sva-bench/world@1'"),
    ("format: sva-bench/world@1", "format: sva-bench/plan@1", "format", "found 'sva-bench/plan@1'"),
    ("bounds_m: [0, 0, 6, 6]", "bounds_m: [0, 0, 6, 0]", "map.shapes.bounds_m", "min below max"),
    ("bounds_m: [0, 0, 6, 6]", "bounds_m: [0, 0, 6, 1.0e9]", "map.shapes.bounds_m", "at most 2000 m"),
    ("wheel_gain_sd: 0.01", "wheel_gain_sd: 0.5", "noise.wheel_gain_sd", "expected at most 0.2"),
    ("name: small\n", "name: small\nfailure: sometimes\n", "failure", "'mission', 'per_leg' or 'hazard'"),
    ("    availability: 0.75\n", "    availability: 0.75\n    mtbf_s: -1\n", "robots.uv2.mtbf_s",
     "expected at least 0"),
    ("    availability: 0.75\n", "    availability: 0.75\n    loss_cost: -1\n", "robots.uv2.loss_cost",
     "expected at least 0"),
    ("name: small\n", "name: small\ninteraction: joint\n", "interaction", "'uncoordinated' or 'shared'"),
    ("name: small\n", "name: small\nreaction: {policy: resolv}\n", "reaction.policy", "'none' or 'resolve'"),
    ("name: small\n", "name: small\nreaction: {policy: resolve, news: soon}\n", "reaction.news",
     "'report' or 'instant'"),
    ("name: small\n", "name: small\nreaction: {polcy: resolve}\n", "reaction.polcy", "did you mean 'policy'"),
    ("name: small\n", "name: small\nreaction: resolve\n", "reaction", "expected a mapping"),
    ("name: small\n", "name: small\nreaction: {policy: none, news: report}\n", "reaction.news", "no use for news"),
    ("name: small\n", "name: small\nreaction: {news: instant}\n", "reaction.news", "choose 'policy: resolve'"),
    ("name: small\n", "name: small\nmargin: -0.1\n", "margin", "expected at least 0"),
])
def test_each_complaint_names_line_and_key(tmp_path: Path, old: str, new: str, key: str | None, says: str) -> None:
    assert_complains(tmp_path, old, new, key, says)


@pytest.mark.parametrize(("old", "new", "key", "says"), [
    ("radius_m: 0.3", "radius: 0.3", "map.shapes.obstacles[2].radius", "did you mean 'radius_m'"),
    ("half: {uv2: 0.5}", "half: {uv2: 1.01}", "scenarios.half.uv2", "expected at most 1"),
    ("half: {uv2: 0.5}", "half: {joint: []}", "scenarios.half.joint", "at least 1"),
    ("incentives: {p1: 10, p2: 20, p3: 30, p4: 40}", "incentives: {p1: -10}", "robots.uv1.incentives.p1",
     "expected at least 0"),
    ("incentives: {p1: 10, p2: 20, p3: 30, p4: 40}", "incentives: {uniform: [5, 1], seed: 0}",
     "robots.uv1.incentives.uniform", "expected [low, high]"),
    ("size_m: [1.2, 0.5]", "size_m: [1.2, 0]", "map.shapes.obstacles[1].size_m[1]", "expected at least 1e-06"),
    ("[[3.0, 0.0], [3.0, 2.6]]", "[[3.0, 0.0], [3.0, 0.0]]", "map.shapes.obstacles[0].wall", "the same point"),
    ("name: small\n", "name: small\nfailure: {plan: mission, execute: never}\n", "failure.execute",
     "'mission', 'per_leg' or 'hazard'"),
    ("model: turtlebot2\n    fuel_capacity_s: 60\n    mission_limit_s: 120\n    avail",
     "model: {radius_m: 0.2}\n    fuel_capacity_s: 60\n    mission_limit_s: 120\n    avail",
     "robots.uv2.model.wheel_radius_m", "is missing; add it"),
])
def test_a_complaint_is_about_the_alternative_that_was_meant(tmp_path: Path, old: str, new: str, key: str, says: str
                                                             ) -> None:
    assert_complains(tmp_path, old, new, key, says)


def assert_complains(folder: Path, old: str, new: str, key: str | None, says: str) -> None:
    assert SMALL.count(old) == 1
    text = SMALL.replace(old, new)
    error = complaint(folder, text)
    assert says in str(error)
    if key is None:
        return
    assert error.key == key
    last = key.rsplit(".", 1)[-1].split("[")[0]
    assert error.line is not None
    if "is missing" not in says:  # a missing key is located at its parent
        assert last in text.splitlines()[error.line - 1], f"line {error.line}"
    assert str(error).startswith(f"{folder / 'world.yaml'}:{error.line}: {key}: ")


def test_an_anchor_that_nothing_refers_to_does_no_harm(tmp_path: Path) -> None:
    assert world_of(tmp_path, SMALL.replace("name: small", "name: &n small")).name == "small"


def test_an_alias_is_refused_with_its_line(tmp_path: Path) -> None:
    text = SMALL.replace("p3: {at_m", "p3: &p {at_m").replace("p4: {at_m: [4.2, 0.8]}", "p4: *p")
    error = complaint(tmp_path, text)
    assert "aliases are not allowed" in str(error)
    assert error.line == line_of(text, "p4: *p")


def test_a_poi_in_an_obstacle_is_named_with_its_line(tmp_path: Path) -> None:
    text = SMALL.replace("[4.2, 0.8]", "[2.2, 4.0]")
    error = complaint(tmp_path, text)
    assert error.line == line_of(text, "p4: {at_m")
    assert "move the site" in error.problem


def test_what_holds_no_world_is_refused(tmp_path: Path) -> None:
    assert "empty" in str(complaint(tmp_path, ""))
    assert "expected a mapping" in str(complaint(tmp_path, "just words"))
    assert "nested deeper" in str(complaint(tmp_path, "a: " + "[" * 50 + "]" * 50))
    (tmp_path / "binary.yaml").write_bytes(bytes(range(256)))
    with pytest.raises(BadFile, match="not UTF-8"):
        load_world(tmp_path / "binary.yaml")
    with pytest.raises(BadFile, match="no such file"):
        load_world(tmp_path / "absent.yaml")


def test_a_bomb_is_refused_quickly(tmp_path: Path) -> None:
    bomb = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    bomb += [f"a{k}: &a{k} [" + ", ".join([f"*a{k - 1}"] * 9) + "]" for k in range(1, 12)]
    begun = time.monotonic()
    complaint(tmp_path, SMALL + "\n".join(bomb))
    assert time.monotonic() - begun < 2  # milliseconds in truth


def test_a_robot_of_ones_own_figures(tmp_path: Path) -> None:
    figures = ("{radius_m: 0.2, wheel_radius_m: 0.04, track_m: 0.3, mass_kg: 5, max_speed_m_s: 1, max_turn_rad_s: 2, "
               "acceleration_m_s2: 1, turn_acceleration_rad_s2: 4}")
    text = SMALL.replace("model: turtlebot2\n    fuel_capacity_s: 60\n    mission_limit_s: 120\n    availability",
                         f"model: {figures}\n    fuel_capacity_s: 60\n    mission_limit_s: 120\n    availability")
    world = world_of(tmp_path, text)
    assert world.robots[1].model.max_speed_m_s == 1
    error = complaint(tmp_path, text.replace("track_m: 0.3", "track_m: 0.5"))
    assert error.key == "robots.uv2.model"
    assert "outside a hull" in str(error)


def test_robots_of_different_figures_have_models_of_different_names(tmp_path: Path) -> None:
    # Fuel costs are kept by the model's name: a robot called like a built-in model must not take its place.
    figures = ("{radius_m: 0.2, wheel_radius_m: 0.04, track_m: 0.3, mass_kg: 5, max_speed_m_s: 1, max_turn_rad_s: 2, "
               "acceleration_m_s2: 1, turn_acceleration_rad_s2: 4}")
    text = SMALL.replace("model: turtlebot2\n    fuel_capacity_s: 60\n    mission_limit_s: 120\n    availability",
                         f"model: {figures}\n    fuel_capacity_s: 60\n    mission_limit_s: 120\n    availability")
    world = world_of(tmp_path, text.replace("uv2", "turtlebot2"))
    first, second = (robot.model for robot in world.robots)
    assert first != second
    assert first.name != second.name


def test_without_scenarios_there_is_one_of_the_robots_availabilities(tmp_path: Path) -> None:
    text = SMALL.replace("scenarios:\n  half: {uv2: 0.5}\n  safe: {uv2: 1.0}\n", "")
    (scenario,) = world_of(tmp_path, text).scenarios
    assert scenario.name == "nominal"
    assert dict(scenario.availability) == {"uv1": 1.0, "uv2": 0.75}


def test_a_joint_scenario_carries_its_marginals(tmp_path: Path) -> None:
    text = SMALL.replace("half: {uv2: 0.5}", "half: {joint: [{probability: 0.6, available: [uv1, uv2]}, "
                                             "{probability: 0.4, available: [uv1]}]}")
    scenario = world_of(tmp_path, text).scenarios[0]
    assert scenario.joint is not None
    assert scenario.availability["uv1"] == pytest.approx(1.0)
    assert scenario.availability["uv2"] == pytest.approx(0.6)


def test_missing_limits_are_no_limits(tmp_path: Path) -> None:
    text = SMALL.replace("fuel_capacity_s: 60\n    mission_limit_s: 120\n    incentives", "incentives")
    assert world_of(tmp_path, text).robots[0].fuel_capacity_s == math.inf
    assert world_of(tmp_path, text).robots[0].mission_limit_s == math.inf


def test_failure_processes_of_planning_and_execution_may_differ(tmp_path: Path) -> None:
    world = world_of(tmp_path, SMALL + "failure: {plan: mission, execute: per_leg}\n")
    assert (world.plan_failure, world.execute_failure) == ("mission", "per_leg")


# Lifetimes


UNLIMITED = SMALL.replace("    mission_limit_s: 120\n    availability: 0.75\n", "    availability: 0.75\n")


@pytest.mark.parametrize("failure", ["hazard", "{plan: mission, execute: hazard}", "{plan: hazard, execute: per_leg}"])
def test_an_availability_without_a_mission_limit_is_refused_where_lifetimes_are_drawn(
        tmp_path: Path, failure: str) -> None:
    text = f"{UNLIMITED}failure: {failure}\n"
    error = complaint(tmp_path, text)
    assert (error.key, error.line) == ("robots.uv2.availability", line_of(text, "availability: 0.75"))
    assert "set mission_limit_s or mtbf_s of the robot" in str(error)
    with_mtbf = text.replace("availability: 0.75", "mtbf_s: 300").replace("  half: {uv2: 0.5}\n", "")
    assert world_of(tmp_path, with_mtbf).robots[1].mtbf_s == 300.0
    # An availability of a scenario replaces the mean, so it has no meaning either.
    error = complaint(tmp_path, text.replace("availability: 0.75", "mtbf_s: 300"))
    assert error.key == "scenarios.half.uv2"


def test_availabilities_of_0_and_1_need_no_mission_limit(tmp_path: Path) -> None:
    text = UNLIMITED.replace("availability: 0.75", "availability: 0.0").replace("half: {uv2: 0.5}", "half: {uv2: 0}")
    means = [mtbf_s(s.reliability(world.robots[1])) for world in (world_of(tmp_path, text + "failure: hazard\n"),)
             for s in world.scenarios]
    assert means == [0.0, math.inf]


def test_a_joint_scenario_is_refused_where_lifetimes_are_drawn(tmp_path: Path) -> None:
    error = complaint(tmp_path, VARIANTS["joint"] + "failure: hazard\n")
    assert error.key == "scenarios.half.joint"


def test_a_scenario_replaces_the_mean_time_to_failure_of_the_robots_it_names(tmp_path: Path) -> None:
    world = world_of(tmp_path, LASTING)
    half, safe = world.scenarios
    # uv1 keeps its 300 s; uv2 survives 120 s of driving with probability 0.5, or always.
    assert [mtbf_s(half.reliability(robot)) for robot in world.robots] == pytest.approx([300, 120 / math.log(2)])
    assert mtbf_s(safe.reliability(world.robots[1])) == math.inf
    assert mtbf_s(nominal_of(world.robots).reliability(world.robots[1])) == 90.0
    # Under the other processes it is as available as it survives the mission limit, unless said otherwise.
    assert [robot.availability for robot in world.robots] == pytest.approx([math.exp(-120 / 300), 0.75])
    assert [robot.loss_cost for robot in world.robots] == [0.0, 25.0]


def test_planning_costs_and_means_hold_the_same_margin(tmp_path: Path) -> None:
    world = world_of(tmp_path, LASTING.replace("name: small\n", "name: small\nmargin: 0.1\n"))
    costs = plan_costs(world, "prmstar", lambda *_: None)
    instance = instance_of(world, costs, world.scenarios[0])
    assert [v.mtbf_s for v in instance.vehicles] == pytest.approx([330, 1.1 * 120 / math.log(2)])
    assert [v.loss_cost for v in instance.vehicles] == [0.0, 25.0]
    # Of a world whose failures don't depend on driving, an instance says what the world says.
    plain = world_of(tmp_path, SMALL)
    assert [v.mtbf_s for v in instance_of(plain, costs, plain.scenarios[0]).vehicles] == [None, None]


def test_what_is_not_set_is_not_written(tmp_path: Path) -> None:
    text = json.dumps(world_as_dict(world_of(tmp_path, SMALL)))
    assert "mtbf_s" not in text
    assert "loss_cost" not in text


# Reactions


@pytest.mark.parametrize(("section", "reaction"), [
    ("", WorldReaction()), ("reaction:\n", WorldReaction()), ("reaction: {}\n", WorldReaction()),
    ("reaction: {policy: none}\n", WorldReaction()), ("reaction: {policy: none, news: never}\n", WorldReaction()),
    ("reaction: {policy: resolve}\n", WorldReaction(policy="resolve", news="report")),
    ("reaction: {policy: resolve, news: }\n", WorldReaction(policy="resolve", news="report")),
    *((f"reaction: {{policy: resolve, news: {news}}}\n", WorldReaction(policy="resolve", news=news)) for news in NEWS),
])
def test_a_team_reacts_as_the_world_says_and_not_at_all_where_it_says_nothing(
    tmp_path: Path, section: str, reaction: WorldReaction
) -> None:
    world = world_of(tmp_path, SMALL + section)
    assert world.reaction == reaction
    # Names of runs depend on the resolved world: one in which nobody reacts is as it was before anybody could.
    assert ("reaction" in world_as_dict(world)) == (reaction.policy != "none")


def test_news_at_stations_takes_a_station(tmp_path: Path) -> None:
    text = SMALL.replace("  stations:\n    r1: {at_m: [3.2, 5.2], stop_s: 4}\n", "")
    assert world_of(tmp_path, text + "reaction: {policy: resolve}\n").stations == ()
    text += "reaction:\n  policy: resolve\n  news: station\n"
    found = complaint(tmp_path, text)
    assert (found.key, found.line) == ("reaction.news", line_of(text, "news: station"))
    assert "place one under sites.stations" in found.problem


def test_the_schema_of_worlds_knows_every_policy_and_all_news() -> None:
    entry = WorldFile.model_json_schema()["$defs"]["ReactionEntry"]
    assert entry["properties"]["policy"]["enum"] == list(POLICY_NAMES)
    assert entry["properties"]["news"]["anyOf"][0]["enum"] == list(NEWS)


# Drawn incentives


def test_the_given_share_of_drawn_incentives_is_zero() -> None:
    pois = [f"p{k}" for k in range(40)]
    drawn = draw_incentives(Drawn(uniform=[10, 150], zero_share=0.5, seed=3), pois)
    assert list(drawn) == pois
    assert sum(value == 0 for value in drawn.values()) == 20
    assert all(value == 0 or 10 <= value <= 150 for value in drawn.values())
    assert all(value == round(value, 2) for value in drawn.values())
    assert draw_incentives(Drawn(uniform=[0, 1], seed=0), []) == {}
    assert set(draw_incentives(Drawn(uniform=[7, 7], zero_share=1.0, seed=0), pois).values()) == {0.0}


def test_drawn_incentives_depend_on_the_seed_alone() -> None:
    pois = [f"p{k}" for k in range(6)]
    once, again, other = (draw_incentives(Drawn(uniform=[0, 170], seed=seed), pois) for seed in (3, 3, 4))
    assert once == again != other
    # A change here changes every world that draws its incentives.
    assert list(once.values()) == pytest.approx([9.45, 16.08, 158.53, 151.14, 78.69, 20.56], abs=1e-9)


# Resolved worlds


def assert_same_world(a: World, b: World, *, exactly: bool) -> None:
    close = assert_array_equal if exactly else assert_allclose
    for name in ("bounds_m", "boxes", "cylinders"):
        close(getattr(a.obstacles, name), getattr(b.obstacles, name))
    assert [(s.name, s.kind, s.x_m, s.y_m, s.stop_s) for s in a.sites] == [
        (s.name, s.kind, s.x_m, s.y_m, s.stop_s) for s in b.sites]
    close([s.heading_rad for s in a.sites], [s.heading_rad for s in b.sites])
    assert [vars(r) for r in a.robots] == [vars(r) for r in b.robots]
    assert [vars(s) for s in a.scenarios] == [vars(s) for s in b.scenarios]
    for name in ("name", "plan_failure", "execute_failure", "margin", "noise", "reaction"):
        assert getattr(a, name) == getattr(b, name)


def written(folder: Path, world: World, kind: str) -> World:
    """The world written out as YAML or JSON, and read again."""
    path = folder / "again.yaml"
    with path.open("w", encoding="utf-8") as file:
        if kind == "json":
            json.dump(world_as_dict(world), file)  # JSON is YAML
        else:
            YAML(typ="safe").dump(world_as_dict(world), file)
    return load_world(path)


LASTING = SMALL.replace("120\n    incentives", "120\n    mtbf_s: 300\n    incentives").replace(
    "    availability: 0.75\n", "    availability: 0.75\n    mtbf_s: 90\n    loss_cost: 25\n") + "failure: hazard\n"
VARIANTS = {
    "lasting": LASTING,
    "lasting in every scenario": LASTING.replace("half: {uv2: 0.5}", "half: {}"),
    "as it is": SMALL,
    "drawn": SMALL.replace("incentives: {p1: 10, p2: 20, p3: 30, p4: 40}",
                           "incentives: {uniform: [0, 150], zero_share: 0.5, seed: 1}"),
    "joint": SMALL.replace("half: {uv2: 0.5}", "half: {joint: [{probability: 0.6, available: [uv1, uv2]}, "
                                               "{probability: 0.4, available: [uv1]}]}"),
    "meeting": SMALL.replace("stop_s: 4}", "stop_s: 4, slots: 2}") + "interaction: shared\n",
    "reacting": SMALL + "reaction: {policy: resolve, news: station}\n",
    "no limits": SMALL.replace("fuel_capacity_s: 60\n    mission_limit_s: 120\n    incentives", "incentives"),
}


@pytest.mark.parametrize("kind", ["yaml", "json"])
@pytest.mark.parametrize("variant", sorted(VARIANTS))
def test_a_resolved_world_is_read_back_as_the_same_world(tmp_path: Path, variant: str, kind: str) -> None:
    world = world_of(tmp_path, VARIANTS[variant])
    # Angles go through degrees and back: the same to a nanoradian.
    assert_same_world(world, written(tmp_path, world, kind), exactly=False)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_worlds_load_the_same_twice_and_are_read_back(tmp_path: Path, path: Path) -> None:
    world = load_world(path)
    assert_same_world(world, load_world(path), exactly=True)
    assert_same_world(world, written(tmp_path, world, "json"), exactly=False)


def test_a_wall_in_any_direction_is_read_back_bit_for_bit(tmp_path: Path) -> None:
    walls = "".join(f"      - {{wall: [[3.4, 4.2], [3.5, {4.3 + 0.01 * k:.2f}]], thickness_m: 0.01}}\n"
                    for k in range(20))
    world = world_of(tmp_path, SMALL.replace("sites:\n", f"{walls}sites:\n"))
    assert_same_world(world, written(tmp_path, world, "json"), exactly=True)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_a_resolved_world_resolves_to_itself_bit_for_bit(tmp_path: Path, path: Path) -> None:
    # The manifest holds the resolved world: running it again must give the same run.
    again = written(tmp_path, load_world(path), "json")
    assert_same_world(load_world(path), again, exactly=True)


ENERGETIC = SMALL.replace("    availability: 0.75\n", "    availability: 0.75\n    idle_share: 0.25\n")


def test_energy_of_a_world_is_that_of_its_instances(tmp_path: Path) -> None:
    world = world_of(tmp_path, SMALL)
    assert {site.charge_rate for site in world.sites} == {None}
    assert not {"idle_share", "charge_rate"} & set(str(world_as_dict(world)).replace("'", "").replace(":", "").split())
    world = world_of(tmp_path, ENERGETIC)
    world = replace(world, sites=tuple(
        replace(site, charge_rate=4.0) if site.kind == "station" else site for site in world.sites))
    assert sorted(robot.idle_share for robot in world.robots) == [0.0, 0.25]
    instance = instance_of(world, plan_costs(world, "prmstar", lambda *_: None), world.scenarios[0])
    assert sorted(vehicle.idle_share for vehicle in instance.vehicles) == [0.0, 0.25]
    assert world.stations
    assert instance.charge_rate is not None
    assert {instance.sites[k] for k in np.flatnonzero(np.isfinite(instance.charge_rate))} == {
        site.name for site in world.stations}
    described = world_as_dict(world)
    assert {entry["charge_rate"] for entry in described["sites"]["stations"].values()} == {4.0}
