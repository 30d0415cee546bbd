"""What every format of maps must keep, from the world file to the run folder and back."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from numpy.testing import assert_array_equal

from sva_bench.errors import BadFile, BadInput
from sva_bench.files.documents import parse_yaml
from sva_bench.files.yaml_text import pretty_yaml
from sva_bench.generate.worlds import world_from_map
from sva_bench.storage.run_folder import MAP, write_map
from sva_bench.world.load import load_world, world_as_dict, world_of
from sva_bench.world.maps.formats import FORMATS, MapFormat, format_of, settings_for
from sva_bench.world.schema import WorldFile
from tests.world.maps_for_tests import write_ros_map

PICTURE = "\n".join(["#" * 16] + ["#" + "." * 14 + "#"] * 6 + ["#" * 7 + "." * 8 + "#"] * 2 + ["#" * 16])


def ros(folder: Path) -> str:
    write_ros_map(folder, PICTURE)
    return "map.yaml"


def movingai(folder: Path) -> str:
    rows = PICTURE.replace("#", "@").split()
    (folder / "room.map").write_text(f"type octile\nheight {len(rows)}\nwidth {len(rows[0])}\nmap\n"
                                     + "\n".join(rows) + "\n")
    return "room.map"


SAMPLES: dict[str, tuple[Callable[[Path], str], dict[str, Any]]] = {
    "ros": (ros, {}), "movingai": (movingai, {"cell_m": 0.5})}
"""For each format a map written into a folder, its file's name, and the settings that make cells half a metre wide."""

every_format = pytest.mark.parametrize("form", FORMATS.values(), ids=list(FORMATS))


def world_text(form: MapFormat, file: str) -> str:
    return pretty_yaml({
        "format": "sva-bench/world@1", "name": "w",
        "map": {form.key: {"file": file, **SAMPLES[form.key][1]}},
        "sites": {"base": {"at_m": [2, 3]}, "pois": {"p1": {"at_m": [4, 3]}, "p2": {"at_m": [6, 2]}}},
        "robots": {"uv1": {"model": "turtlebot2", "incentives": {"p1": 1}}}}, {})


def sample(form: MapFormat, folder: Path) -> str:
    folder.mkdir(parents=True, exist_ok=True)
    return SAMPLES[form.key][0](folder)


def test_every_format_has_a_sample_here() -> None:
    assert set(SAMPLES) == set(FORMATS)


@every_format
def test_a_format_goes_by_its_key_and_the_schema_knows_it(form: MapFormat) -> None:
    assert FORMATS[form.key] is form
    assert form.key in WorldFile.model_json_schema()["$defs"]["Map"]["properties"]


@every_format
def test_a_map_is_read_with_the_digests_of_its_files(form: MapFormat, tmp_path: Path) -> None:
    file = sample(form, tmp_path)
    world = world_of(parse_yaml(world_text(form, file), tmp_path / "w.yaml"))
    assert_array_equal(world.obstacles.bounds_m, [0, 0, 8, 5])
    assert world.map_source is not None
    assert world.map_source.files[0].name == file
    assert world.digests() == {
        entry.name: hashlib.sha256((tmp_path / entry.name).read_bytes()).hexdigest()
        for entry in world.map_source.files}


@every_format
@pytest.mark.parametrize(("name", "problem"), [
    ("missing", "no such file"), (".", "not a file"), ("../outside", "lies outside the world's folder"),
    ("/etc/hostname", "no name relative to the world's folder")])
def test_a_file_that_is_missing_or_outside_the_folder_is_an_error_of_its_key(
    form: MapFormat, name: str, problem: str, tmp_path: Path,
) -> None:
    sample(form, tmp_path / "here")
    (tmp_path / "outside").write_text("")
    with pytest.raises(BadFile, match=rf"w\.yaml:\d+: map\.{form.key}\.file: .*{problem}"):
        world_of(parse_yaml(world_text(form, name), tmp_path / "here" / "w.yaml"))


@every_format
def test_an_unknown_key_below_a_format_is_refused(form: MapFormat, tmp_path: Path) -> None:
    text = world_text(form, sample(form, tmp_path)).replace("file:", "strange: 1, file:")
    with pytest.raises(BadFile, match=f"map.{form.key}.*strange"):
        world_of(parse_yaml(text, tmp_path / "w.yaml"))


@every_format
def test_a_run_folder_gives_the_same_world_again(form: MapFormat, tmp_path: Path) -> None:
    world = world_of(parse_yaml(world_text(form, sample(form, tmp_path / "there")), tmp_path / "there" / "w.yaml"))
    assert world.map_source is not None
    write_map(tmp_path, world.files)
    stored = json.loads(json.dumps(world_as_dict(world)))
    again = world_of(parse_yaml(pretty_yaml(stored, {}), tmp_path / MAP / "w.yaml"))
    assert again.obstacles.key() == world.obstacles.key()
    assert again.map_source is not None
    assert again.digests() == world.digests()
    assert world_as_dict(again) == world_as_dict(world)


@every_format
def test_a_map_is_known_by_its_name_and_by_its_content(form: MapFormat, tmp_path: Path) -> None:
    file = sample(form, tmp_path)
    assert format_of(tmp_path / file) is form
    assert form.suffixes
    with pytest.raises(BadFile, match=re.escape(f"this is a {form.maps.removesuffix('s')}")):
        load_world(tmp_path / file)


@every_format
def test_a_world_from_a_map_records_its_command_and_can_be_read(form: MapFormat, tmp_path: Path) -> None:
    file, target = sample(form, tmp_path), tmp_path / "made.yaml"
    text, files = world_from_map(tmp_path / file, target, base=None, pois=4, stations=1, robots=2, spacing_m=None,
                                 settings=SAMPLES[form.key][1], seed=0, progress=lambda *_: None)
    for entry in files:
        (tmp_path / entry.name).parent.mkdir(exist_ok=True)
        (tmp_path / entry.name).write_bytes(entry.content)
    target.write_text(text)
    assert f"sva-bench world from-map {file}" in text
    for option, value in SAMPLES[form.key][1].items():
        assert f"--{option.replace('_', '-')} {value:g}" in text
    source = load_world(target).map_source
    assert source is not None
    assert source.section[form.key]["file"] == f"made-map/{file}"


@every_format
def test_an_option_of_another_format_is_refused_with_the_reason(form: MapFormat) -> None:
    others = {key for other in FORMATS.values() if other is not form for key in other.section.model_fields} \
        - set(form.section.model_fields)
    assert others
    for option in others:
        with pytest.raises(BadInput, match=f"--{option.replace('_', '-')} belongs to .* maps; a"):
            settings_for(form, {option: 1.0})
        assert settings_for(form, {option: None}) == {}


def test_a_file_of_no_format_is_refused_with_what_there_is() -> None:
    with pytest.raises(BadInput, match=r"a map is the YAML file of a ROS map, or a MovingAI map .* \.map$"):
        format_of(Path("plan.json"))
