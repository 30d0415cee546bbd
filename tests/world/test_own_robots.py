"""Robots of one's own in world files: like a built-in one, or described in a URDF, and all that is refused."""

from __future__ import annotations

import json
import os
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from sva_bench.batch.folder import begin, settings_in, write_maps
from sva_bench.batch.grid import Grid, Point, grid_of
from sva_bench.batch.jobs import TravelTimesJob
from sva_bench.errors import BadFile, ExitCode
from sva_bench.files.codec import decoded, encoded
from sva_bench.robot.model import BUILT_IN, RobotModel
from sva_bench.robot.urdf import MAX_BYTES, MAX_SOLIDS
from sva_bench.solver.two_stage import SolveLimits
from sva_bench.study.options import Options
from sva_bench.world.load import load_world, world_as_dict
from sva_bench.world.model import World
from tests.commands_for_tests import sva_bench
from tests.robot.urdfs_for_tests import SAMPLE, inertial
from tests.worlds_for_tests import SMALL, world_of

EXAMPLE = Path(__file__).parents[2] / "examples" / "own-robots"
URDF = "{urdf: robot.urdf, left_wheel: left_joint, right_wheel: right_joint, max_speed_m_s: 0.5}"


def small(model: str, other: str = "turtlebot2") -> str:
    """The small world with these models of its two robots."""
    first, second, third = SMALL.split("model: turtlebot2")
    return f"{first}model: {model}{second}model: {other}{third}"


def described(folder: Path, text: str | bytes = SAMPLE.text(), model: str = URDF) -> World:
    """The small world with a robot of this URDF."""
    (folder / "robot.urdf").write_bytes(text.encode() if isinstance(text, str) else text)
    return world_of(folder, small(model))


def test_a_robot_like_a_built_in_one_differs_in_what_is_said_alone(tmp_path: Path) -> None:
    world = world_of(tmp_path, small("{like: turtlebot2, max_speed_m_s: 0.4, mass_kg: 9}"))
    model = world.robots[0].model
    assert model == replace(BUILT_IN["turtlebot2"], name="uv1-model", max_speed_m_s=0.4, mass_kg=9)


def test_two_robots_like_the_same_one_keep_their_own_figures(tmp_path: Path) -> None:
    like = "{{like: turtlebot2, max_speed_m_s: {}}}"
    world = world_of(tmp_path, small(like.format(0.4), like.format(0.3)))
    assert {robot.model.name: robot.model.max_speed_m_s for robot in world.robots} == {
        "uv1-model": 0.4, "uv2-model": 0.3}
    again = world_of(tmp_path, json.dumps(world_as_dict(world)))
    assert [robot.model for robot in again.robots] == [robot.model for robot in world.robots]


@pytest.mark.parametrize(("model", "key", "said"), [
    ("{like: turtlebot, mass_kg: 9}", "robots.uv1.model.like", "did you mean 'turtlebot2'?"),
    ("{like: turtlebot2, max_speed: 0.4}", "robots.uv1.model.max_speed", "did you mean 'max_speed_m_s'?"),
    ("{like: turtlebot2, max_speed_m_s: 40}", "robots.uv1.model.max_speed_m_s", "at most 20"),
    ("{like: turtlebot2, track_m: 0.06}", "robots.uv1.model", "too narrow"),
    ("{mass_kg: 9}", "robots.uv1.model.radius_m", "missing"),
    ("{urdf: robot.urdf, left_wheel: a, max_speed_m_s: 1}", "robots.uv1.model.right_wheel", "missing"),
    ("[turtlebot2]", "robots.uv1.model", "expected a word"),
    ("huski", "robots.uv1.model", "did you mean 'husky'?"),
])
def test_a_wrong_model_is_refused_at_its_key(model: str, key: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(BadFile) as refused:
        world_of(tmp_path, small(model))
    assert refused.value.key == key
    assert said in refused.value.problem
    assert refused.value.line is not None


def test_a_described_robot_has_the_figures_of_its_urdf(tmp_path: Path) -> None:
    robot = described(tmp_path).robots[0]
    model = robot.model
    assert model.wheel_radius_m == 0.06
    assert model.track_m == pytest.approx(0.32)
    assert model.mass_kg == pytest.approx(9.0 + 2 * 0.4 + 2 * 0.09)
    # The box is 0.40 x 0.28 m with its middle 0.05 m ahead of the axle: its farthest corner is at (0.25, 0.14).
    assert model.radius_m == pytest.approx((0.25**2 + 0.14**2) ** 0.5 + 0.002, abs=1e-6)
    assert (model.max_speed_m_s, model.max_turn_rad_s, model.acceleration_m_s2) == (0.5, 2.0, 0.5)
    assert robot.urdf is not None
    assert robot.urdf.file.name == "robot.urdf"


T = SAMPLE.text()
BAD: list[tuple[str, str | bytes, str]] = [
    ("no XML", "robot: {}", "not well-formed XML"),
    ("a picture", b"\x89PNG\r\n\x1a\n\x00\x00", "not well-formed XML"),
    ("cut off", T[:900], "not well-formed XML"),
    ("an empty file", "", "not well-formed XML: no element found"),
    ("another language", "<sdf version='1.7'/>", "expected a URDF, whose outermost element is <robot>, found <sdf>"),
    ("xacro", T.replace("<link name=\"hull\">", "<xacro:wheel/><link name=\"hull\">"), "expand it first"),
    ("a property of xacro", T.replace("9.0", "${mass}"), "expand it first"),
    ("an unknown encoding", f"<?xml version='1.0' encoding='klingon'?>{T}", "save it as UTF-8"),
    ("a bomb of entities", "<!DOCTYPE robot [<!ENTITY a 'aaaa'><!ENTITY b '&a;&a;&a;'>]>" + T, "document type"),
    ("a file of somebody else's", "<!DOCTYPE robot [<!ENTITY x SYSTEM 'file:///etc/passwd'>]>" + T, "document type"),
    ("deeper than any robot", "<robot>" + "<a>" * 100 + "</a>" * 100 + "</robot>", "more than 64 levels"),
    ("longer than any robot", "<robot>" + "<a/>" * 60_000 + "</robot>", "more than 50000 elements"),
    ("too many solids", T.replace("</link>", "<collision><geometry><sphere radius='0.001'/></geometry></collision>"
                                  * (MAX_SOLIDS + 1) + "</link>", 1), f"more than {MAX_SOLIDS} collision shapes"),
    ("no link", "<robot/>", "it has no link"),
    ("two links of a name", T.replace('link name="c1"', 'link name="c0"', 1), "another link of this name"),
    ("two joints of a name", T.replace('joint name="c1_joint"', 'joint name="c0_joint"'), "another joint of this name"),
    ("a joint to nowhere", T.replace('child link="c1"', 'child link="c3"'), "there is no link 'c3'; did you mean"),
    ("a loose link", T.replace("</robot>", "<link name='loose'/></robot>"), "nothing joins the links"),
    ("a circle", T.replace("</robot>", "<joint name='o' type='fixed'><parent link='c0'/><child link='hull'/></joint>"
                           "</robot>"), "its joints run in a circle"),
    ("two parents", T.replace("</robot>", "<joint name='o' type='fixed'><parent link='c0'/><child link='c1'/></joint>"
                              "</robot>"), "has another parent"),
    ("a floating joint", T.replace('name="c0_joint" type="fixed"', 'name="c0_joint" type="floating"'),
     "a joint of type 'floating' can't be held"),
    ("no type", T.replace(' type="fixed"', "", 1), "<joint> has no type; add it"),
    ("a mesh", T.replace('<sphere radius="0.015"/>', "<mesh filename='a.stl'/>", 1), "meshes are not read"),
    ("a capsule", T.replace('<sphere radius="0.015"/>', "<capsule radius='1'/>", 1), "unknown shape <capsule>"),
    ("no size", T.replace(' radius="0.015"', "", 1), "<sphere> has no radius; add it"),
    ("a negative size", T.replace("0.015", "-0.015", 1), "the sizes of a solid must be from"),
    ("a size of zero", T.replace("0.015", "0", 1), "the sizes of a solid must be from"),
    ("an endless size", T.replace("0.015", "1e300", 1), "expected a number of at most 1e+06 in radius"),
    ("a size that is none", T.replace("0.015", "nan", 1), "expected a number of at most 1e+06 in radius, found 'nan'"),
    ("a size of words", T.replace("0.015", "1_0", 1), "found '1_0'"),
    ("no mass", T.replace('<mass value="9.0"/>', ""), "<inertial> has no <mass>; add it"),
    ("a mass of zero", T.replace('value="9.0"', 'value="0"'), "its mass is 0 kg"),
    ("a negative mass", T.replace('value="9.0"', 'value="-9"'), "its mass is -9 kg"),
    ("a mass beyond all", T.replace('value="9.0"', 'value="inf"'), "in value, found 'inf'"),
    ("no inertia of a solid", T.replace(inertial(0.09, (0.03, 0.03, 0.03)), "", 1), "but no <inertial>"),
    ("negative inertia", T.replace('ixx="', 'ixx="-', 1), "isn't positive about every axis"),
    ("inertia in g mm2", replace(SAMPLE, inertia_times=1e5).text(), "Check the inertias, and their unit"),
    ("hardly any inertia", replace(SAMPLE, inertia_times=1e-4).text(), "Check the inertias, and their unit"),
    ("two inertials", T.replace("<collision>", inertial(1, (1, 1, 1)) + "<collision>", 1), "another <inertial>"),
    ("a wheel without a shape", T.replace('<collision><geometry><cylinder radius="0.06" length="0.024"/></geometry>'
                                          "</collision>", "", 1), "a driven wheel needs a <collision>"),
    ("a square wheel", T.replace('<cylinder radius="0.06" length="0.024"/>', "<box size='.1 .1 .02'/>", 1),
     "must be a cylinder about the axis"),
    ("a wheel on its side", T.replace('<axis xyz="0 0 1"/>', '<axis xyz="1 0 0"/>', 1), "must be a cylinder about"),
    ("an upright axle", T.replace('<axis xyz="0 0 1"/>', '<axis xyz="0 1 0"/>', 1), "parallel to the floor"),
    ("no axis", T.replace('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>', 1), "its axis has no direction"),
    ("a fixed wheel", T.replace('name="left_joint" type="continuous"', 'name="left_joint" type="fixed"'),
     "a driven wheel's joint must turn"),
    ("unequal wheels", T.replace('radius="0.06"', 'radius="0.05"', 1), "driven wheels must be equal"),
    ("a wheel higher than the other", T.replace('xyz="0.02 0.16 0.0"', 'xyz="0.02 0.16 0.01"'), "at another height"),
    ("wheels one ahead of the other", T.replace('xyz="0.02 0.16 0.0"', 'xyz="0.06 0.16 0.0"'), "on the axle of"),
    ("wheels in one place", T.replace('xyz="0.02 0.16 0.0"', 'xyz="0.02 -0.16 0.0"'), "in one place"),
    ("left and right exchanged", T.replace('"left_joint"', '"l"').replace('"right_joint"', '"left_joint"')
     .replace('"l"', '"right_joint"'), "exchange left_wheel and right_wheel"),
    ("an axle along", replace(SAMPLE, base_m=(0.0, 0.0, 0.0)).text().replace("0.0 0.16 0.0", "0.16 0.0 0.0")
     .replace("0.0 -0.16 0.0", "-0.16 0.0 0.0").replace(" 0 0\"/><parent", " 0 -1.5707963267948966\"/><parent"),
     "across the x axis"),
    ("a hull that drags", T.replace('<sphere radius="0.015"/>', '<sphere radius="0.03"/>', 1),
     "below the driven wheels, which would hang in the air"),
    ("nothing ahead to stand on", replace(SAMPLE, casters_m=(-0.12,)).text(), "the robot tips over"),
    ("mass beyond the caster", replace(SAMPLE, centre_m=(0.3, 0.0, 0.06)).text(), "the robot tips over"),
    ("mass beyond the wheels", replace(SAMPLE, centre_m=(0.04, 0.2, 0.06)).text(), "0.180 m aside, beyond"),
    ("mass too high", replace(SAMPLE, centre_m=(0.04, 0.0, 3.0)).text(), "it would tip over"),
    ("a robot too large", replace(SAMPLE, box_m=(12.0, 6.0, 0.16)).text(), "follows radius_m: expected at most 5"),
]


@pytest.mark.parametrize(("text", "said"), [case[1:] for case in BAD], ids=[case[0] for case in BAD])
def test_a_bad_urdf_is_refused_with_one_clear_message(text: str | bytes, said: str, tmp_path: Path) -> None:
    with pytest.raises(BadFile) as refused:
        described(tmp_path, text)
    assert said in str(refused.value)
    assert "robot.urdf" in str(refused.value) or "robots.uv1.model" in str(refused.value)
    assert "\n" not in str(refused.value)
    assert refused.value.line is not None
    assert refused.value.exit_code is ExitCode.BAD_INPUT


def test_what_is_wrong_with_a_urdf_is_all_that_a_command_says(tmp_path: Path) -> None:
    (tmp_path / "w.yaml").write_text(small(URDF))
    (tmp_path / "robot.urdf").write_text(T.replace('<sphere radius="0.015"/>', "<mesh filename='a.stl'/>", 1))
    done = sva_bench("world", "check", "w.yaml", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    assert " ".join(done.stderr.split()) == (
        "error: robot.urdf:9: link c0: meshes are not read: replace this collision shape by boxes, cylinders or "
        "spheres about it; <visual> may keep the mesh")


def test_the_other_joints_of_a_robot_are_held_and_its_visuals_ignored(tmp_path: Path) -> None:
    turning = T.replace('name="c0_joint" type="fixed"', 'name="c0_joint" type="continuous"').replace(
        "<inertial>", "<visual><geometry><mesh filename='package://x/y.dae'/></geometry></visual><inertial>", 1)
    assert described(tmp_path, turning).robots[0].model == described(tmp_path).robots[0].model


@pytest.mark.parametrize("name", ["left_wheel", "right_wheel"])
def test_a_joint_that_the_urdf_lacks_is_an_error_of_the_world_file(name: str, tmp_path: Path) -> None:
    with pytest.raises(BadFile, match=r"robot\.urdf has no joint 'ring'; known: ") as refused:
        described(tmp_path, model=URDF.replace(f"{name}: {name.split('_')[0]}_joint", f"{name}: ring"))
    assert refused.value.key == f"robots.uv1.model.{name}"


def test_exchanged_wheels_are_an_error_of_the_world_file(tmp_path: Path) -> None:
    exchanged = URDF.replace("left_joint", "x").replace("right_joint", "left_joint").replace("x,", "right_joint,")
    with pytest.raises(BadFile, match=r"in robot\.urdf 'right_joint' is to the right of 'left_joint', seen along the x "
                       r"axis of '\w+', which points ahead; exchange left_wheel and right_wheel") as refused:
        described(tmp_path, model=exchanged)
    assert (refused.value.path, refused.value.key) == (str(tmp_path / "world.yaml"), "robots.uv1.model.left_wheel")
    assert refused.value.line is not None
    assert "left_wheel" in (tmp_path / "world.yaml").read_text().splitlines()[refused.value.line - 1]


def test_one_joint_is_not_both_wheels(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match="it is the left wheel too"):
        described(tmp_path, model=URDF.replace("right_joint", "left_joint"))


@pytest.mark.parametrize("limit", ["acceleration_m_s2: 9", "turn_acceleration_rad_s2: 60"])
def test_limits_that_the_body_cannot_keep_to_are_refused_at_the_model(limit: str, tmp_path: Path) -> None:
    with pytest.raises(BadFile, match=r"tip over|slip") as refused:
        described(tmp_path, model=URDF.replace("}", f", {limit}}}"))
    assert refused.value.key == "robots.uv1.model"


@pytest.mark.parametrize(("casters", "said"), [
    ((0.2,), r" 0\.[12]\d\d m ahead and 0\.000 m behind"), ((-0.2, 0.2), r" 0\.[12]\d\d m ahead and 0\.[12]\d\d m ")])
def test_where_a_tipping_robot_stands_is_never_a_negative_zero(casters: tuple[float, ...], said: str, tmp_path: Path
                                                               ) -> None:
    with pytest.raises(BadFile, match="tip over") as refused:
        described(tmp_path, replace(SAMPLE, casters_m=casters).text(), URDF.replace("}", ", acceleration_m_s2: 20}"))
    assert re.search(said, str(refused.value))
    assert "-0.0" not in str(refused.value)


@pytest.mark.parametrize(("name", "said"), [
    ("../robot.urdf", "outside the world's folder"),
    ("/etc/passwd", "no name relative to the world's folder"),
    ("~/robot.urdf", "no name relative to the world's folder"),
    ("missing.urdf", "no such file"),
    ("link.urdf", "outside the world's folder"),
    ("circle.urdf", "no such file"),
    ("pipe.urdf", "not a file"),
    ("folder.urdf", "not a file"),
    ("huge.urdf", f"at most {MAX_BYTES} are read"),
])
def test_a_urdf_is_a_file_within_the_folder_of_its_world(name: str, said: str, tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    (tmp_path / "robot.urdf").write_text(T)
    (home / "link.urdf").symlink_to(tmp_path / "robot.urdf")
    (home / "circle.urdf").symlink_to(home / "circle.urdf")
    os.mkfifo(home / "pipe.urdf")
    (home / "folder.urdf").mkdir()
    with open(home / "huge.urdf", "wb") as file:
        file.truncate(MAX_BYTES + 1)
    with pytest.raises(BadFile) as refused:
        world_of(home, small(URDF.replace("robot.urdf", name)))
    assert said in refused.value.problem
    assert refused.value.key == "robots.uv1.model.urdf"
    (home / "inner.urdf").write_text(T)
    (home / "alias.urdf").symlink_to("inner.urdf")
    world_of(home, small(URDF.replace("robot.urdf", "alias.urdf")))


def test_another_content_of_the_urdf_is_another_world(tmp_path: Path) -> None:
    def job(world: World) -> TravelTimesJob:
        return TravelTimesJob(world=world, model=world.robots[0].model, planner="prmstar")

    world, heavier = described(tmp_path), described(tmp_path, replace(SAMPLE, mass_kg=9.5).text())
    assert world_as_dict(world) == world_as_dict(heavier)
    assert world.digests() != heavier.digests()
    assert job(world).key != job(heavier).key
    assert job(world).key == job(described(tmp_path)).key


def test_a_described_robot_travels_to_workers_and_back_to_the_bit(tmp_path: Path) -> None:
    model = described(tmp_path).robots[0].model
    assert decoded(encoded(model, RobotModel), RobotModel) == model


def test_a_batch_folder_holds_the_urdf_and_goes_on_without_the_world(tmp_path: Path) -> None:
    world = described(tmp_path)
    options = Options(trials=10, rollouts=2, fidelity="kinematic", limits=SolveLimits())
    grid = Grid(points=[Point(world=world, planner="prmstar")], seeds=[0], options=options, unit_trials=10)
    (tmp_path / "batch").mkdir()
    begin(tmp_path / "batch", grid.settings(), resume=False)
    write_maps(tmp_path / "batch", grid.map_files())
    held = grid_of(*settings_in(tmp_path / "batch"))
    assert held.settings() == grid.settings()
    assert held.points[0].world.robots[0].model == world.robots[0].model


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the example world, and its run."""
    folder = tmp_path_factory.mktemp("own") / "own"
    shutil.copytree(EXAMPLE, folder)
    done = sva_bench("run", "world.yaml", "--trials", 20, "--rollouts", 2, "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder


def test_several_models_in_one_world_are_run_recorded_and_kept_with_their_files(example: Path) -> None:
    (run,) = (example / "runs").iterdir()
    times = pq.read_table(run / "travel_times.parquet").to_pylist()
    assert {row["model"] for row in times} == {"create3", "slow-model", "trolley-model"}
    longest = {model: max(row["raw_s"] for row in times if row["model"] == model)
               for model in ("create3", "slow-model", "trolley-model")}
    assert longest["trolley-model"] < longest["slow-model"] < longest["create3"]
    assert (run / "map" / "trolley.urdf").read_bytes() == (EXAMPLE / "trolley.urdf").read_bytes()
    resolved = json.loads((run / "manifest.json").read_text())["world"]
    assert resolved["robots"]["trolley"]["model"]["urdf"] == "trolley.urdf"
    assert list((run / "recordings").glob("*.rrd"))
    legs = pq.read_table(run / "legs.parquet").to_pylist()
    assert {row["robot"] for row in legs} >= {"scout", "slow"}
    off = [abs(row["driven_s"] / row["planned_s"] - 1) for row in legs if row["planned_s"] > 5]
    assert sorted(off)[len(off) // 2] < 0.02  # wheel gains have a deviation of 1 %
    assert sva_bench("report", run, cwd=example).returncode == 0


def test_a_trial_of_described_robots_is_replayed_from_the_run_folder_alone(example: Path) -> None:
    (run,) = (example / "runs").iterdir()
    outcomes = pq.read_table(run / "outcomes.parquet").to_pylist()
    kept = {(row["planner"], row["robot"]): row["end_time_s"] for row in outcomes
            if (row["scenario"], row["trial"], row["policy"]) == ("S2", 3, "none")}
    (example / "trolley.urdf").rename(example / "away.urdf")
    try:
        done = sva_bench("replay", run, "--scenario", "S2", "--trial", 3, "--json", cwd=example)
    finally:
        (example / "away.urdf").rename(example / "trolley.urdf")
    assert done.returncode == 0, done.stderr
    assert kept
    for (planner, robot), end_s in kept.items():
        assert f'"{planner}"' in done.stdout
        assert f'"{robot}"' in done.stdout
        assert str(end_s) in done.stdout


@pytest.mark.long
def test_several_models_in_one_world_are_checked_drawn_and_swept(example: Path) -> None:
    checked = sva_bench("world", "check", "world.yaml", cwd=example)
    assert checked.returncode == 0, checked.stderr
    for model in ("create3", "slow-model", "trolley-model"):
        assert model in checked.stdout + checked.stderr
    assert sva_bench("world", "draw", "world.yaml", "-o", "w.png", "--paths", cwd=example).returncode == 0
    assert (example / "w.png").stat().st_size > 10_000
    refused = sva_bench("world", "draw", "world.yaml", "-o", "trolley.urdf", cwd=example)
    assert refused.returncode == 2
    swept = sva_bench("batch", "world.yaml", "--trials", 10, "--rollouts", 2, "--out", "b",
                      "--workers", 2, "--set", "robots.trolley.model.max_speed_m_s=0.4,0.5",
                      "--policy", "resolve", cwd=example)
    assert swept.returncode == 0, swept.stderr
    assert len(list((example / "b").glob("*/trolley.urdf"))) == 1


def test_the_example_is_read_as_it_stands() -> None:
    assert [robot.model.name for robot in load_world(EXAMPLE / "world.yaml").robots] == [
        "create3", "slow-model", "trolley-model"]
