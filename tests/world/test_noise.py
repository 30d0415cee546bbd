"""Noise in world files: its spellings, its mistakes, and that a world written out is the same world."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from ruamel.yaml import YAML

from sva_bench.errors import BadFile
from sva_bench.geometry.outside import is_outside
from sva_bench.world.load import load_world, world_as_dict
from sva_bench.world.model import World
from sva_bench.world.noise import REALISTIC, LocalisationError, Noise, Passage, People
from sva_bench.world.noise_schema import NoiseEntry, noise_as_dict
from tests.worlds_for_tests import SMALL, world_of

SAID = "noise: {wheel_gain_sd: 0.01}\n"
FLOORS = "    floors: [{box: [1.0, 3.0], size_m: [0.8, 0.4], yaw_deg: 30, friction: 0.15}]\n"
PASSAGES = "passages:\n  d1: {at_m: [[3.0, 2.6], [3.0, 6.0]], blocked: 0.25, wait_s: 30}\n"


def saying(folder: Path, noise: str) -> World:
    return world_of(folder, SMALL.replace(SAID, f"{noise}\n"))


@pytest.mark.parametrize(("said", "means"), [
    ("noise:", Noise()), ("noise: {}", Noise()), ("", Noise()),
    ("noise: realistic", REALISTIC), ("noise: {preset: realistic}", REALISTIC),
    ("noise: {preset: realistic, capacity_sd: 0}", replace(REALISTIC, capacity_sd=0.0)),
    ("noise: {preset: realistic, localisation: null}", replace(REALISTIC, localisation=None)),
    ("noise: {preset: realistic, delay_s: [0, 0]}", replace(REALISTIC, delay_s=(0.0, 0.0))),
    ("noise: {preset: realistic, people: {per_m: 0.05, stop_s: 4}}",
     replace(REALISTIC, people=People(per_m=0.05, stop_s=4.0))),
    ("noise: {preset: realistic, localisation: {sd_m: 0.03}}",
     replace(REALISTIC, localisation=LocalisationError(sd_m=0.03, sd_deg=2.0, length_m=0.5))),
    ("noise: {preset: null, capacity_sd: 0.1}", Noise(capacity_sd=0.1)),
    ("noise: {localisation: {sd_m: 0.03, length_m: 1}}",
     Noise(localisation=LocalisationError(sd_m=0.03, sd_deg=0.0, length_m=1.0))),
    # No error and nobody in the way are what they are without the key.
    ("noise: {localisation: {sd_m: 0, length_m: 1}, people: {per_m: 0, stop_s: 4}}", Noise()),
    ("noise: {people: {per_m: 1, stop_s: 0}}", Noise())])
def test_each_spelling_of_noise_means_what_it_says(tmp_path: Path, said: str, means: Noise) -> None:
    assert saying(tmp_path, said).noise == means


def test_a_key_beside_the_preset_counts_whichever_comes_first(tmp_path: Path) -> None:
    for said in ("{speed_gain_sd: 0.1, preset: realistic}", "{preset: realistic, speed_gain_sd: 0.1}"):
        assert saying(tmp_path, f"noise: {said}").noise == replace(REALISTIC, speed_gain_sd=0.1)


@pytest.mark.parametrize(("said", "key", "says"), [
    *((f"noise: {word}", "noise", "did you mean 'realistic'? expected 'realistic', or a mapping")
      for word in ("realistc", "Realistic", "'realistic '", "[realistic]", "[realistc]")),
    *((f"noise: {word}", "noise", "for no noise leave the key out, or write nothing behind it")
      for word in ("off", "none", "no", "false", "0", "[]", "calm", "[off, on]", "realistc")),
    ("noise: {preset: calm}", "noise.preset", "'realistic'"),
    ("noise: 3", "noise", "mapping"),
    ("noise: {delay_s: [0.03, 0.16]}", "noise.delay_s", "at most 0.15 s"),
    ("noise: {delay_s: [0.1, 0.05]}", "noise.delay_s", "expected [least, greatest]"),
    ("noise: {delay_s: [-0.1, 0.05]}", "noise.delay_s[0]", "expected at least 0"),
    ("noise: {delay_s: 0.05}", "noise.delay_s", "two numbers [least, most], found 0.05"),
    ("noise: {delay_s: [0.05]}", "noise.delay_s", "two numbers [least, most], found 1 entry"),
    ("noise: {capacity_fade: [0.2, 0.1]}", "noise.capacity_fade", "expected [least, greatest]"),
    ("noise: {capacity_fade: [0, 1]}", "noise.capacity_fade[1]", "expected at most 0.95"),
    ("noise: {payload_kg: [5, 1]}", "noise.payload_kg", "expected [least, greatest]"),
    ("noise: {capacity_sd: -0.1}", "noise.capacity_sd", "expected at least 0"),
    ("noise: {capacity_sd: .nan}", "noise.capacity_sd", "finite"),
    ("noise: {capacity_sd: lots}", "noise.capacity_sd", "number"),
    ("noise: {capacity_sd: true}", "noise.capacity_sd", "number"),
    ("noise: {speed_gain_sd: 0.3}", "noise.speed_gain_sd", "expected at most 0.2"),
    ("noise: {hull_friction: .inf}", "noise.hull_friction", "finite"),
    ("noise: {localisation: {sd_m: 0.2, length_m: 0.5}}", "noise.localisation", "at most 0.2 of length_m"),
    ("noise: {localisation: {sd_m: 0.05}}", "noise.localisation.length_m", "is missing"),
    ("noise: {localisation: {sd_m: 0.05, length_m: 0}}", "noise.localisation.length_m", "expected at least 0.05"),
    ("noise: {localisation: 0.05}", "noise.localisation", "mapping"),
    ("noise: {people: {per_m: 1}}", "noise.people.stop_s", "is missing"),
    ("noise: {people: {per_m: .nan, stop_s: 1}}", "noise.people.per_m", "finite"),
    ("noise: {capacity: 0.1}", "noise.capacity", "did you mean 'capacity_sd'"),
])
def test_what_is_wrong_with_noise_is_one_complaint_with_line_and_key(tmp_path: Path, said: str, key: str, says: str
                                                                    ) -> None:
    assert_complains(tmp_path, SMALL.replace(SAID, f"{said}\n"), key, says)


@pytest.mark.parametrize(("said", "key", "says"), [
    ("passages: {d1: {at_m: [[1, 1], [1, 1]], blocked: 0.1, wait_s: 1}}", "passages.d1.at_m", "the same point"),
    ("passages: {d1: {at_m: [[1, 1]], blocked: 0.1, wait_s: 1}}", "passages.d1.at_m", "expected two points"),
    ("passages: {d1: {at_m: [[1, 1], [1, 2]], blocked: 1.5, wait_s: 1}}", "passages.d1.blocked", "expected at most 1"),
    ("passages: {d1: {at_m: [[1, 1], [1, 2]], blocked: 0.5, wait_s: -1}}", "passages.d1.wait_s",
     "expected at least 0"),
    ("passages: {d1: {at_m: [[1, 1], [1, .nan]], blocked: 0.5, wait_s: 1}}", "passages.d1.at_m[1][1]", "finite"),
    ("passages: {d1: {at_m: [[1, 1], [1, 2]], wait_s: 1}}", "passages.d1.blocked", "is missing"),
    ("passages: 3", "passages", "mapping")])
def test_what_is_wrong_with_a_passage_is_one_complaint_with_line_and_key(tmp_path: Path, said: str, key: str, says: str
                                                                        ) -> None:
    assert_complains(tmp_path, f"{SMALL}{said}\n", key, says)


@pytest.mark.parametrize(("floor", "key", "says"), [
    ("{box: [1, 1], size_m: [0, 1], friction: 0.1}", "size_m[0]", "expected at least 1e-06"),
    ("{box: [1, 1], size_m: [1, 1], friction: 0}", "friction", "expected at least 0.01"),
    ("{box: [1, 1], size_m: [1, 1]}", "friction", "is missing"),
    ("{box: [1, 1], size_m: [1, 1], friction: 0.1, yaw: 3}", "yaw", "did you mean 'yaw_deg'")])
def test_what_is_wrong_with_a_floor_is_one_complaint_with_line_and_key(tmp_path: Path, floor: str, key: str, says: str
                                                                      ) -> None:
    text = SMALL.replace("sites:\n", f"    floors: [{floor}]\nsites:\n", 1)
    assert_complains(tmp_path, text, f"map.shapes.floors[0].{key}", says)


OUT_OF_BOUNDS = [(7.0, 3.0), (-1.0, 3.0), (3.0, 7.0), (3.0, -1.0), (6.8, 6.8)]


@pytest.mark.parametrize("at", OUT_OF_BOUNDS)
def test_a_passage_outside_the_bounds_is_refused_with_line_and_key(tmp_path: Path, at: tuple[float, float]) -> None:
    (x, y), ends = at, (-0.5, 0.5)
    for passage in ([[x, y - 0.5], [x, y + 0.5]], [[x - 0.5, y], [x + 0.5, y]], [[x + a, y - a] for a in ends]):
        text = f"{SMALL}passages:\n  d1: {{at_m: {passage}, blocked: 0.5, wait_s: 1}}\n"
        assert_complains(tmp_path, text, "passages.d1.at_m", "outside the bounds, 0 to 6 m and 0 to 6 m")


@pytest.mark.parametrize("at", OUT_OF_BOUNDS)
@pytest.mark.parametrize("yaw", [0, 30, 45, 200])
def test_a_floor_outside_the_bounds_is_refused_with_line_and_key(tmp_path: Path, at: tuple[float, float], yaw: float
                                                                 ) -> None:
    floor = f"    floors: [{{box: {list(at)}, size_m: [1.2, 0.4], yaw_deg: {yaw}, friction: 0.1}}]\n"
    assert_complains(tmp_path, SMALL.replace("sites:\n", f"{floor}sites:\n", 1), "map.shapes.floors[0].box",
                     "outside the bounds")


@given(st.floats(-4, 10), st.floats(-4, 10), st.floats(0, math.tau), st.floats(0.1, 6), st.floats(0.1, 6))
def test_what_has_a_point_inside_the_bounds_is_not_outside_them(x: float, y: float, yaw: float, length: float,
                                                               width: float) -> None:
    # A grid of points of the shape, among them its corners: if one is inside, the shape is not outside. What lies
    # between the grid's points may be inside all the same, by less than a step of the grid.
    steps = np.linspace(-0.5, 0.5, 41)
    along, across = np.array([math.cos(yaw), math.sin(yaw)]), np.array([-math.sin(yaw), math.cos(yaw)])
    points = np.array([(x, y) + a * length * along + b * width * across for a in steps for b in steps])
    corners = points[[0, 40, -1, -41]]
    inside = ((points > 0) & (points < 6)).all(axis=1).any()
    nearly = ((points > -0.2) & (points < 6.2)).all(axis=1).any()
    assert is_outside(corners, np.array([0.0, 0.0, 6.0, 6.0])) <= (not inside)
    assert nearly or is_outside(corners, np.array([0.0, 0.0, 6.0, 6.0]))


def test_a_passage_on_the_outer_walls_is_outside_and_one_that_reaches_in_is_not(tmp_path: Path) -> None:
    for ends, outside in (([[6, 1], [6, 3]], True), ([[5.9, 1], [6, 1]], False), ([[-1, 5], [3, 9]], True),
                          ([[-1, 5], [2, 7]], False)):  # 5 + (x + 1) is 6 at x = 0; 5 + 2 / 3 (x + 1) is below it
        text = f"{SMALL}passages:\n  d1: {{at_m: {ends}, blocked: 0.5, wait_s: 1}}\n"
        if outside:
            assert_complains(tmp_path, text, "passages.d1.at_m", "outside the bounds")
        else:
            world_of(tmp_path, text)


def assert_complains(folder: Path, text: str, key: str, says: str) -> None:
    with pytest.raises(BadFile) as caught:
        world_of(folder, text)
    error = caught.value
    assert says in str(error)
    assert error.key == key
    assert error.line is not None
    assert str(error).startswith(f"{folder / 'world.yaml'}:{error.line}: {key}: ")
    if "is missing" not in says:
        assert key.rsplit(".", 1)[-1].split("[")[0] in text.splitlines()[error.line - 1]
    assert str(error).count("\n") == 0


shares = st.floats(0, 0.2)


def pairs(most: float) -> st.SearchStrategy[tuple[float, float]]:
    return st.tuples(st.floats(0, most), st.floats(0, most)).map(lambda pair: (min(pair), max(pair)))


errors = st.builds(LocalisationError, sd_m=st.floats(0.001, 0.2), sd_deg=st.floats(0, 30), length_m=st.floats(1, 100))
noises = st.builds(
    Noise, wheel_gain_sd=shares, speed_gain_sd=shares, track_gain_sd=shares, localisation=st.none() | errors,
    delay_s=pairs(0.15), capacity_sd=shares, capacity_fade=pairs(0.95), payload_kg=pairs(1e5),
    hull_friction=st.floats(0, 5), people=st.none() | st.builds(People, per_m=st.floats(0.1, 10),
                                                               stop_s=st.floats(0.1, 3600)))


@given(noises)
def test_noise_written_out_is_read_back_as_itself(noise: Noise) -> None:
    assert NoiseEntry.model_validate(noise_as_dict(noise)).noise() == noise


def test_floors_passages_and_noise_of_a_world_written_out_are_read_back_as_themselves(tmp_path: Path) -> None:
    text = SMALL.replace("sites:\n", f"{FLOORS}sites:\n", 1).replace(SAID, "noise: realistic\n") + PASSAGES
    world = world_of(tmp_path, text)
    assert world.passages == (Passage(name="d1", ends_m=(3.0, 2.6, 3.0, 6.0), blocked=0.25, wait_s=30.0),)
    assert len(world.obstacles.floors) == 1
    with (tmp_path / "again.yaml").open("w", encoding="utf-8") as file:
        YAML(typ="safe").dump(world_as_dict(world), file)
    again = load_world(tmp_path / "again.yaml")
    assert (again.noise, again.passages) == (world.noise, world.passages)
    assert_array_equal(again.obstacles.floors, world.obstacles.floors)


def test_a_world_without_them_says_nothing_of_passages_and_floors(tmp_path: Path) -> None:
    content = world_as_dict(world_of(tmp_path))
    assert "passages" not in content
    assert "floors" not in content["map"]["shapes"]
    assert content["noise"] == {"wheel_gain_sd": 0.01}


@pytest.mark.parametrize(("said", "passages", "noisy"), [
    ("noise: {}", "", False), ("noise: {hull_friction: 0.4}", "", False), ("noise: {capacity_sd: 0.01}", "", True),
    ("noise: {people: {per_m: 0.1, stop_s: 3}}", "", True), ("noise: {payload_kg: [1, 2]}", "", True),
    ("noise: {}", PASSAGES, True),
    ("noise: {}", PASSAGES.replace("0.25", "1.0"), False),  # always shut: every rollout waits alike
    ("noise: {}", PASSAGES.replace("0.25", "0.0"), False)])
def test_rollouts_differ_where_something_is_drawn_for_them(tmp_path: Path, said: str, passages: str, noisy: bool
                                                          ) -> None:
    assert world_of(tmp_path, SMALL.replace(SAID, f"{said}\n") + passages).noisy == noisy


def test_the_world_of_the_page_is_one_and_the_page_has_every_key(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "noise.md").read_text(encoding="utf-8")
    world = world_of(tmp_path, page.split("```yaml\n")[1].split("```")[0])
    assert world.noise == replace(REALISTIC, capacity_fade=(0.0, 0.2))
    assert len(world.passages) == len(world.obstacles.floors) == 1
    assert [key for key in NoiseEntry.model_fields if key != "preset" and f"| `noise.{key}` |" not in page] == []
