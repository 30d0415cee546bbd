"""What robots are to each other, as world files say it: words, slots of stations, and what is as it was before."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import pytest

from sva_bench.choices import INTERACTIONS, Interaction
from sva_bench.errors import BadFile, BadInput
from sva_bench.files.pretty import pretty_json
from sva_bench.study.inputs import load
from sva_bench.world.load import world_as_dict
from sva_bench.world.schema import MOST_SLOTS, WorldFile
from sva_bench.world.variants import adapted
from tests.worlds_for_tests import SMALL, world_of

SLOTS = SMALL.replace("r1: {at_m: [3.2, 5.2], stop_s: 4}", "r1: {at_m: [3.2, 5.2], stop_s: 4, slots: 2}")
ALONE = SMALL[:SMALL.index("  uv2:\n    model")] + SMALL[SMALL.index("scenarios:"):].replace(
    "scenarios:\n  half: {uv2: 0.5}\n  safe: {uv2: 1.0}\n", "")
DOOR = "passages: {door: {at_m: [[3.0, 2.6], [4.1, 3.2]], blocked: 0.5, wait_s: 5}}\n"


@pytest.mark.parametrize("interaction", get_args(Interaction))
def test_robots_are_to_each_other_what_the_world_says(interaction: Interaction, tmp_path: Path) -> None:
    world = world_of(tmp_path, f"{SMALL}interaction: {interaction}\n")
    assert world.interaction == interaction
    assert world.meets == (interaction != "independent")
    # Where they meet each has costs of its own, for it leaves from a berth of its own.
    assert [world.kind_of(robot) for robot in world.robots] == (
        ["uv1", "uv2"] if world.meets else ["turtlebot2", "turtlebot2"])


@pytest.mark.parametrize("interaction", get_args(Interaction))
def test_one_robot_meets_nobody(interaction: Interaction, tmp_path: Path) -> None:
    world = world_of(tmp_path, f"{ALONE}interaction: {interaction}\n")
    assert not world.meets
    assert world.kind_of(world.robots[0]) == "turtlebot2"


def test_a_world_in_which_nobody_meets_is_written_as_before_there_was_another(tmp_path: Path) -> None:
    # Names of runs depend on it.
    silent = pretty_json(world_as_dict(world_of(tmp_path)))
    assert pretty_json(world_as_dict(world_of(tmp_path, f"{SMALL}interaction: independent\n"))) == silent
    assert "interaction" not in silent
    assert "slots" not in silent
    one_slot = SLOTS.replace("slots: 2", "slots: 1")
    assert pretty_json(world_as_dict(world_of(tmp_path, one_slot))) == silent


@pytest.mark.parametrize("interaction", ["uncoordinated", "shared"])
def test_what_robots_are_to_each_other_is_written_and_read_back(interaction: str, tmp_path: Path) -> None:
    told = world_as_dict(world_of(tmp_path, f"{SLOTS}interaction: {interaction}\n"))
    again = world_of(tmp_path, pretty_json(told))
    assert again.interaction == interaction
    assert [site.slots for site in again.sites] == [1, 2, 1, 1, 1, 1]
    assert world_as_dict(again) == told


def test_stations_that_are_placed_automatically_have_slots_too(tmp_path: Path) -> None:
    text = SMALL.replace("    r1: {at_m: [3.2, 5.2], stop_s: 4}\n", "    spread: 2\n    slots: 3\n")
    assert [site.slots for site in world_of(tmp_path, text).stations] == [3, 3]


@pytest.mark.parametrize(("value", "says"), [
    ("0", "expected at least 1, found 0"), ("-2", "expected at least 1"), ("2.5", "expected an integer"),
    ("2.0", "expected an integer"), ("true", "expected an integer"), ("'2'", "expected an integer"),
    ("[2]", "expected an integer"), (str(MOST_SLOTS + 1), f"expected at most {MOST_SLOTS}"), ("null", "expected an")])
def test_slots_are_a_number_of_robots(value: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(BadFile) as caught:
        world_of(tmp_path, SLOTS.replace("slots: 2", f"slots: {value}"))
    assert caught.value.key == "sites.stations.r1.slots"
    assert caught.value.line == SLOTS[:SLOTS.index("slots: 2")].count("\n") + 1
    assert says in caught.value.problem


@pytest.mark.parametrize(("old", "key"), [
    ("p1: {at_m: [2.2, 0.8]", "sites.pois.p1"), ("base: {at_m: [0.8, 0.8]", "sites.base")])
def test_only_stations_have_slots(old: str, key: str, tmp_path: Path) -> None:
    with pytest.raises(BadFile) as caught:
        world_of(tmp_path, SMALL.replace(old, f"{old}, slots: 2"))
    assert caught.value.key == key
    assert "only stations have 'slots'" in caught.value.problem


@pytest.mark.parametrize("word", ["joint", "Shared", "none", "[shared]", "{mode: shared}", "true", "1", ""])
def test_an_unknown_interaction_is_refused_with_the_words_that_there_are(word: str, tmp_path: Path) -> None:
    with pytest.raises(BadFile) as caught:
        world_of(tmp_path, f"{SMALL}interaction: {word}\n")
    assert caught.value.key == "interaction"
    assert caught.value.line == SMALL.count("\n") + 1
    assert all(name in caught.value.problem for name in INTERACTIONS)


@pytest.mark.parametrize("word", ["Shared", "SHARED", "share", "sharred"])
def test_a_mistyped_interaction_is_refused_with_the_word_that_was_meant(word: str, tmp_path: Path) -> None:
    with pytest.raises(BadFile, match=r"found .*; did you mean 'shared'\?"):
        world_of(tmp_path, f"{SMALL}interaction: {word}\n")


def test_the_schema_knows_every_interaction_and_the_bounds_of_slots() -> None:
    schema = WorldFile.model_json_schema()
    assert schema["properties"]["interaction"]["enum"] == list(INTERACTIONS)
    for section in ("StationEntry", "SpreadStations"):
        slots = schema["$defs"][section]["properties"]["slots"]
        assert (slots["minimum"], slots["maximum"], slots["default"]) == (1, MOST_SLOTS, 1)
    assert "slots" not in schema["$defs"]["SiteEntry"]["properties"]


@pytest.mark.parametrize("name", ["door", "people"])
def test_a_robot_that_others_wait_for_has_a_name_of_its_own(name: str, tmp_path: Path) -> None:
    text = (SMALL + DOOR).replace("uv2", name)
    alone = world_of(tmp_path, text)  # nobody waits for it
    with pytest.raises(BadFile, match="rename the robot") as caught:
        world_of(tmp_path, f"{text}interaction: shared\n")
    assert caught.value.key == f"robots.{name}"
    with pytest.raises(BadInput, match=rf"robots\.{name}: .*rename the robot"):
        adapted(alone, interaction="shared")


@pytest.mark.parametrize("interaction", ["independent", "uncoordinated"])
def test_departures_are_staggered_of_coordinated_robots_alone(interaction: Interaction, tmp_path: Path) -> None:
    path = tmp_path / "staggered.yaml"
    path.write_text(f"{SMALL}interaction: shared\ndepartures: staggered\n", encoding="utf-8")
    assert load(path).departures == "staggered"
    assert load(path, departures="together").departures == "together"
    assert load(path, interaction=interaction, departures="together").interaction == interaction
    with pytest.raises(BadInput, match=f"departures can't be staggered under interaction {interaction}"):
        load(path, interaction=interaction)
    path.write_text(f"{SMALL}departures: staggered\n", encoding="utf-8")  # what an option makes of it counts
    assert load(path, interaction="shared").departures == "staggered"
    with pytest.raises(BadInput, match="take departures together, or interaction shared"):
        load(path)


def test_staggered_departures_are_written_and_read_back_and_usual_ones_are_not(tmp_path: Path) -> None:
    told = world_as_dict(world_of(tmp_path, f"{SMALL}interaction: shared\ndepartures: staggered\n"))
    assert told["departures"] == "staggered"
    assert "departures" not in world_as_dict(world_of(tmp_path, f"{SMALL}interaction: shared\n"))
    with pytest.raises(BadFile, match="did you mean 'staggered'"):
        world_of(tmp_path, f"{SMALL}departures: stagered\n")


def test_an_option_takes_the_place_of_what_the_file_says(tmp_path: Path) -> None:
    path = tmp_path / "shared.yaml"
    path.write_text(f"{SMALL}interaction: shared\n", encoding="utf-8")
    assert load(path).interaction == "shared"
    assert load(path, interaction="independent").interaction == "independent"
    assert load(path, interaction="uncoordinated").interaction == "uncoordinated"
