"""What is said of maps that hardly mean what they say, and what is read of them from elsewhere."""

from __future__ import annotations

import logging
import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from sva_bench.errors import BadFile
from sva_bench.files.documents import read_json, read_yaml
from sva_bench.files.json_lines import json_line
from sva_bench.generate.worlds import world_from_map
from sva_bench.world.load import load_world
from sva_bench.world.maps.images import BadImage, grey_image
from sva_bench.world.maps.movingai import read_movingai_map
from sva_bench.world.maps.ros import read_ros_map
from tests.world.maps_for_tests import write_pgm, write_ros_map

ROOM = "\n".join(["#" * 16] + ["#" + "." * 14 + "#"] * 12 + ["#" * 16])
MARK = b"\xef\xbb\xbf"


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def made(folder: Path, target: Path, **asked: object) -> str:
    options = {"base": None, "pois": 4, "stations": 1, "robots": 2, "settings": {},
               "spacing_m": None, "seed": 0, "progress": lambda *_: None} | asked
    text, files = world_from_map(folder / "map.yaml", target, **options)  # type: ignore[arg-type]
    for file in files:
        path = target.parent / file.name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(file.content)
    target.write_text(text)
    return text


@pytest.mark.parametrize(("picture", "says"), [
    ("##\n##", "4 are occupied and 0 unknown; look at negate"),
    ("#?\n??", "1 are occupied and 3 unknown; look at whether unknown cells are free .*--unknown free")])
def test_a_map_without_a_free_cell_is_refused_with_counts_of_its_cells(tmp_path: Path, picture: str, says: str) -> None:
    write_ros_map(tmp_path, picture)
    with pytest.raises(BadFile, match=f"no cell of the map is free: {says}"):
        read_ros_map(tmp_path, "map.yaml")


def test_an_octile_map_without_a_free_cell_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.map").write_text("type octile\nheight 1\nwidth 3\nmap\n@TW\n")
    with pytest.raises(BadFile, match="all 3 are solid"):
        read_movingai_map(tmp_path, "a.map", 1.0)


@pytest.mark.parametrize(("old", "new", "says"), [
    ("[0, 0, 0]", "[0, 0, 90]", "yaw is 90, more than a turn: it is in radians; 90 degrees are 1.5708"),
    ("free_thresh: 0.196", "free_thresh: 0.25", "grey level 205, which many maps use for unknown"),
    ("negate: 0", "negate: 0\ntype: indoor", "not used: 'type'")])
def test_a_notice_names_the_users_file_and_comes_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, old: str, new: str, says: str
) -> None:
    write_ros_map(tmp_path, ROOM.replace("#.", "#?"))
    edit(tmp_path / "map.yaml", old, new)
    with caplog.at_level(logging.WARNING):
        made(tmp_path, tmp_path / "w.yaml")
    notices = [record.getMessage() for record in caplog.records if says in record.getMessage()]
    assert len(notices) == 1
    assert notices[0].startswith(f"{tmp_path}/map.yaml: ")


def test_a_usual_map_is_read_without_a_word(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    write_ros_map(tmp_path, ROOM.replace("#.", "#?"))
    with caplog.at_level(logging.WARNING):
        made(tmp_path, tmp_path / "w.yaml")
    assert not caplog.records


def test_sites_outside_the_walls_give_a_warning(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    inner = ROOM.splitlines()
    picture = "\n".join(["." * 40] * 10 + ["." * 12 + line + "." * 12 for line in inner] + ["." * 40] * 10)
    write_ros_map(tmp_path, picture)
    with caplog.at_level(logging.WARNING):
        made(tmp_path, tmp_path / "w.yaml")
    assert "outside of all walls" in caplog.text
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        made(tmp_path, tmp_path / "v.yaml", base=(10.0, 8.5))
    assert not caplog.records


@pytest.mark.parametrize("absolute", [True, False])
def test_an_image_elsewhere_is_copied_by_from_map_and_refused_in_worlds(tmp_path: Path, absolute: bool) -> None:
    maps, pictures, target = tmp_path / "maps", tmp_path / "pictures", tmp_path / "worlds" / "w.yaml"
    for folder in (maps, pictures, target.parent):
        folder.mkdir()
    write_ros_map(maps, ROOM)
    (maps / "map.pgm").rename(pictures / "plan.pgm")
    elsewhere = f"{pictures}/plan.pgm" if absolute else "../pictures/plan.pgm"
    edit(maps / "map.yaml", "image: map.pgm", f"image: {elsewhere}  # the scan")
    with pytest.raises(BadFile, match="absolute path" if absolute else "outside the world's folder"):
        read_ros_map(maps, "map.yaml")
    made(maps, target)
    copy = target.parent / "w-map"
    assert read_yaml(copy / "map.yaml").data["image"] == "plan.pgm"
    assert "# the scan" in (copy / "map.yaml").read_text()
    assert (copy / "plan.pgm").read_bytes() == (pictures / "plan.pgm").read_bytes()
    assert load_world(target).map_source is not None


def test_byte_order_marks_are_read_over(tmp_path: Path) -> None:
    write_ros_map(tmp_path, "#.")
    plain, _ = read_ros_map(tmp_path, "map.yaml")
    (tmp_path / "map.yaml").write_bytes(MARK + (tmp_path / "map.yaml").read_bytes())
    (tmp_path / "map.pgm").write_bytes(MARK + b"P2\n2 1\n255\n0 254\n")
    marked, _ = read_ros_map(tmp_path, "map.yaml")
    np.testing.assert_array_equal(plain.occupied, marked.occupied)
    (tmp_path / "a.map").write_bytes(MARK + b"type octile\nheight 1\nwidth 1\nmap\n.\n")
    read_movingai_map(tmp_path, "a.map", 1.0)
    (tmp_path / "a.json").write_bytes(MARK + b'{"a": 1}')
    assert read_json(tmp_path / "a.json").data == {"a": 1}
    (tmp_path / "a.json").write_bytes('{"a": 1}'.encode("utf-16"))
    with pytest.raises(BadFile, match="save it as UTF-8"):
        read_json(tmp_path / "a.json")


def test_pipes_and_devices_are_refused_unopened(tmp_path: Path) -> None:
    write_ros_map(tmp_path, "#.")
    os.mkfifo(tmp_path / "pipe")
    edit(tmp_path / "map.yaml", "map.pgm", "pipe")
    for reading in (lambda: read_yaml(tmp_path / "pipe"), lambda: read_json(Path("/dev/zero")),
                    lambda: read_ros_map(tmp_path, "map.yaml"), lambda: read_movingai_map(tmp_path, "pipe", 1.0),
                    lambda: read_ros_map(tmp_path, "map.yaml", anywhere=True)):
        with pytest.raises(BadFile, match="not a file"):
            reading()


@pytest.mark.parametrize("most", [255, 100, 1000])
def test_numbers_written_out_give_the_levels_that_pil_gives(most: int, tmp_path: Path) -> None:
    levels = np.random.default_rng(0).integers(0, most + 1, (7, 5))
    rows = "\n".join(" ".join(map(str, row)) + " # row" for row in levels.tolist())
    text = f"P2 # greys\n5 7\n{most}\n{rows}\n"
    path = tmp_path / "a.pgm"
    path.write_text(text)
    with Image.open(path) as image:
        deep = np.asarray(image, dtype=np.float64)
    expected = np.round(deep / 257) if most > 255 else deep
    np.testing.assert_allclose(grey_image(text.encode()).level, expected, atol=1 if most > 255 else 0)
    bits = "P1\n3 2\n101\n0 1 0\n"
    np.testing.assert_array_equal(grey_image(bits.encode()).level, [[0, 255, 0], [255, 0, 255]])


@pytest.mark.parametrize("text", ["P2\n2 1\n255\n1", "P2\n2 1\n0\n1 1", "P2\n2 1\n255\n1 -1", "P1\n2 1\n1 2",
                                  "P3\n1 1\n255\n1 2", "P2\n2", "P2\n2 1\n255\n1 99999999999999999999"])
def test_broken_numbers_are_one_complaint(text: str) -> None:
    with pytest.raises(BadImage, match="no picture"):
        grey_image(text.encode())


def test_a_line_of_a_large_matrix_is_found_in_one_walk() -> None:
    rows = [[0.5] * 400 for _ in range(400)]
    text = '{"a": {"b\\"c": 1},\n "fuel_s": [\n' + ",\n".join(map(str, rows)) + '\n],\n "z": [1,\n 2]}'
    assert json_line(text, ("fuel_s", 399, 7)) == 402
    assert json_line(text, ("z", 1)) == 405
    assert json_line(text, ("a", 'b"c')) == 1
    assert json_line(text, ("gone", 1)) == 1
    assert json_line("{", ("a",)) is None


def test_yaml_of_too_many_values_is_refused_by_number(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sva_bench.files.yaml_text.MAX_YAML_VALUES", 50)
    (tmp_path / "a.yaml").write_text("a: [" + "1, " * 60 + "1]\n")
    with pytest.raises(BadFile, match="more than 50 keys and values"):
        read_yaml(tmp_path / "a.yaml")


def test_a_map_of_lines_without_end_is_refused(tmp_path: Path) -> None:
    write_pgm(tmp_path / "map.pgm", [[0]])
    (tmp_path / "a.map").write_bytes(b"type octile\nheight 2\nwidth 1\nmap\n" + b"\n" * 1000 + b".\n")
    with pytest.raises(BadFile, match="expected 2 rows"):
        read_movingai_map(tmp_path, "a.map", 1.0)
