"""Maps as ROS and MovingAI write them, and what is wrong with broken ones."""

from __future__ import annotations

import logging
import math
import zlib
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from numpy.typing import NDArray
from PIL import Image

from sva_bench.choices import MapMode
from sva_bench.errors import BadFile
from sva_bench.world.maps.images import grey_image
from sva_bench.world.maps.movingai import read_movingai_map
from sva_bench.world.maps.ros import occupancy, read_ros_map, solid_cells
from tests.world.maps_for_tests import YAML, shared_map, write_pgm, write_ros_map

SPECTRUM = np.arange(256, dtype=np.uint8)[None]


def pgm_of(level: NDArray[np.uint8]) -> bytes:
    return b"P5 %d %d 255\n" % level.shape[::-1] + level.tobytes()


def read_spectrum(
    mode: MapMode, *, negate: bool = False, occupied: float = 0.65, free: float = 0.1
) -> NDArray[np.int8]:
    value = occupancy(grey_image(pgm_of(SPECTRUM)), negate=negate, occupied_thresh=occupied, free_thresh=free,
                      mode=mode)
    return np.array(value[0])


def test_the_row_at_the_bottom_comes_first_and_unknown_is_occupied(tmp_path: Path) -> None:
    write_ros_map(tmp_path, "#.? ...", origin="[2, 3.5, 0.0]")
    cells, files = read_ros_map(tmp_path, "map.yaml")
    assert_array_equal(cells.occupied, [[False, False, False], [True, False, True]])
    assert_array_equal(cells.origin, [2, 3.5, 0])
    assert [file.name for file in files] == ["map.yaml", "map.pgm"]
    assert files[1].content == (tmp_path / "map.pgm").read_bytes()
    free, _ = read_ros_map(tmp_path, "map.yaml", "free")
    assert_array_equal(free.occupied, [[False, False, False], [True, False, False]])


def test_a_map_of_the_ros_1_tests_reads_as_expected_there() -> None:
    folder = shared_map("ros/nav1_tests")
    cells, _ = read_ros_map(folder, "testmap.yaml")
    expected = np.loadtxt(folder / "testmap_expected_rows_from_bottom.csv", delimiter=",", dtype=int)
    assert_array_equal(cells.occupied, expected == 100)
    assert_array_equal(cells.origin, [2.0, 3.0, 1.0])
    assert cells.cell_m == 0.1


def test_every_grey_level_counts_as_ros_1_expects_it() -> None:
    # From map_server's own tests: 90 occupied, 26 free, 140 unknown; in scale mode 140 between, of which Nav2, which
    # rounds, calls one 0: level 229 is (26 / 255 - 0.1) / 0.55 = 0.36 % of the way. Raw, each value once.
    trinary = read_spectrum("trinary")
    assert [(trinary == value).sum() for value in (100, 0, -1)] == [90, 26, 140]
    scale = read_spectrum("scale")
    assert [(scale == 100).sum(), (scale == 0).sum(), ((scale > 0) & (scale < 100)).sum()] == [90, 27, 139]
    assert scale[229] == 0
    assert_array_equal(read_spectrum("raw"), [*range(101), *[-1] * 155])


def test_scale_mode_interpolates_between_the_thresholds_as_nav2_expects_it() -> None:
    # From nav2_map_server's own tests, thresholds 0.65 and 0.196: (1 - 147 / 255 - 0.196) / 0.454 = 0.50.
    scale = read_spectrum("scale", free=0.196)
    assert [scale[k] for k in (0, 89, 90, 147, 204, 205, 255)] == [100, 100, 99, 50, 1, 0, 0]
    negated = read_spectrum("scale", negate=True, free=0.196)
    assert [negated[k] for k in (0, 108, 165, 166, 255)] == [0, 50, 99, 100, 100]


def test_a_pixel_at_a_threshold_is_occupied_or_free_as_in_current_nav2() -> None:
    # 1 - 126 / 255 = 129 / 255 is at the upper threshold; 1 - 204 / 255 = 0.2 at the lower one. ROS 1: both unknown.
    trinary = read_spectrum("trinary", occupied=129 / 255, free=0.2)
    assert [trinary[k] for k in (126, 127, 203, 204)] == [100, -1, -1, 0]


def test_what_is_between_the_thresholds_counts_as_unknown_in_every_mode() -> None:
    # Level 150: 0.412 of the way to black. Raw, 50 %.
    cases: list[tuple[MapMode, int]] = [("trinary", 150), ("scale", 150), ("raw", 50)]
    for mode, level in cases:
        value = occupancy(grey_image(pgm_of(np.array([[level]], dtype=np.uint8))), negate=False, occupied_thresh=0.65,
                          free_thresh=0.196, mode=mode)
        assert solid_cells(value, occupied_thresh=0.65, free_thresh=0.196, unknown="occupied")
        assert not solid_cells(value, occupied_thresh=0.65, free_thresh=0.196, unknown="free")


@pytest.mark.parametrize(("mode", "suffix"), [
    ("L", "pgm"), ("L", "png"), ("L", "bmp"), ("RGB", "png"), ("RGB", "bmp"), ("RGBA", "png"), ("P", "png"),
    ("P", "bmp"), ("1", "png"), ("1", "bmp"), ("LA", "png"), ("I;16", "png"), ("RGB", "ppm")])
def test_every_kind_of_picture_reads_the_same(tmp_path: Path, mode: str, suffix: str) -> None:
    grey = Image.fromarray(np.array([[0, 255, 255], [255, 0, 255]], dtype=np.uint8))
    image = Image.fromarray(np.array(grey, dtype=np.uint16) * 257) if mode == "I;16" else grey.convert(mode)
    image.save(tmp_path / f"map.{suffix}")
    (tmp_path / "map.yaml").write_text(YAML.format(image=f"map.{suffix}", resolution=1, origin="[0, 0, 0]"))
    cells, _ = read_ros_map(tmp_path, "map.yaml")
    assert_array_equal(cells.occupied, [[False, True, False], [True, False, False]])


def test_ascii_pgm_reads_with_comments_and_its_own_white(tmp_path: Path) -> None:
    (tmp_path / "map.pgm").write_bytes(b"P2\n# CREATOR: test\n3 2\n100\n0 100 100\n100 0 100\n")
    (tmp_path / "map.yaml").write_text(YAML.format(image="map.pgm", resolution=1, origin="[0, 0, 0]"))
    cells, _ = read_ros_map(tmp_path, "map.yaml")
    assert_array_equal(cells.occupied, [[False, True, False], [True, False, False]])


def test_transparent_pixels_are_unknown_but_in_raw_mode() -> None:
    image = grey_image(pgm_of(np.array([[255, 0]], dtype=np.uint8)))
    clear = type(image)(level=image.level, opaque=np.array([[False, False]]))
    thresholds = {"negate": False, "occupied_thresh": 0.65, "free_thresh": 0.196}
    assert_array_equal(occupancy(clear, mode="trinary", **thresholds), [[-1, -1]])  # type: ignore[arg-type]
    assert_array_equal(occupancy(clear, mode="raw", **thresholds), [[-1, 0]])  # type: ignore[arg-type]


def test_quotes_integers_truth_values_and_unused_keys_are_read_as_in_ros(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write_ros_map(tmp_path, "#.")
    (tmp_path / "map.yaml").write_text(
        "image: map.pgm\nresolution: '1'\norigin: [0, -1, 7]\nnegate: no\noccupied_thresh: 1\nfree_thresh: 0.196\n"
        "mode: Trinary\ncost_translation_table: [1, 2]\n")
    with caplog.at_level(logging.WARNING):
        cells, _ = read_ros_map(tmp_path, "map.yaml")
    assert_array_equal(cells.occupied, [[True, False]])
    assert cells.origin[2] == pytest.approx(7 - 2 * math.pi)
    assert "not used: 'cost_translation_table'" in caplog.text


def png_of(columns: int, rows: int, body: bytes) -> bytes:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return len(data).to_bytes(4, "big") + kind + data + zlib.crc32(kind + data).to_bytes(4, "big")

    header = columns.to_bytes(4, "big") + rows.to_bytes(4, "big") + bytes([8, 0, 0, 0, 0])
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(body)) + chunk(b"IEND", b""))


@pytest.mark.parametrize(("content", "complaint"), [
    (b"", "neither PGM nor PNG nor BMP"), (b"hello", "neither PGM"), (b"P5\n4 4\n255\n" + bytes(7), "no picture"),
    (b"P5\n-4 4\n255\n" + bytes(16), "no picture"), (b"P5\n0 4\n255\n", "no picture"),
    (b"P2\n2 1\n255\n1 x\n", "no picture"),
    (b"P5\n99999999 99999999\n255\n", "pixels"), (b"P2\n2 1\n255\n1 300\n", "no picture"),
    (png_of(10_000, 10_000, bytes(10_001 * 10_000)), "10000 x 10000 pixels; at most 16000000"),
    (png_of(30_000, 30_000, b""), "far more than the 16000000 pixels"), (png_of(4, 4, bytes(9)), "no picture"),
    (b"BM" + bytes(60), "no picture")])
def test_a_broken_lying_or_huge_image_is_one_complaint(tmp_path: Path, content: bytes, complaint: str) -> None:
    write_ros_map(tmp_path, "#.")
    (tmp_path / "map.pgm").write_bytes(content)
    with pytest.raises(BadFile, match=complaint) as caught:
        read_ros_map(tmp_path, "map.yaml")
    assert caught.value.path == str(tmp_path / "map.pgm")


@pytest.mark.parametrize(("old", "new", "key", "complaint"), [
    ("image: map.pgm", "image: gone.pgm", "image", "no such file"),
    ("image: map.pgm", "image: ../map.pgm", "image", "outside the world's folder"),
    ("image: map.pgm", "image: /etc/passwd", "image", "absolute path"),
    ("image: map.pgm", "image: .", "image", "not a file"),
    ("image: map.pgm", "image: [1]", "image", "expected the name"),
    ("resolution: 0.5", "resolution: 0", "resolution", "expected a number from 0.0001 to 100, found 0"),
    ("resolution: 0.5", "resolution: wide", "resolution", "found 'wide'"),
    ("resolution: 0.5\n", "", "resolution", "the key 'resolution' is missing"),
    ("[0, 0, 0]", "[0, 0]", "origin", "expected \\[x, y, yaw\\]"),
    ("[0, 0, 0]", "[0, 0, nan]", "origin", "expected \\[x, y, yaw\\]"),
    ("negate: 0", "negate: 2", "negate", "expected 0 or 1"),
    ("free_thresh: 0.196", "free_thresh: 0.9", "free_thresh", "above occupied_thresh"),
    ("negate: 0", "negate: 0\nmode: trinaryy", "mode", "did you mean 'trinary'")])
def test_an_error_in_the_yaml_names_key_and_line(
    tmp_path: Path, old: str, new: str, key: str, complaint: str
) -> None:
    write_ros_map(tmp_path, "#.")
    path = tmp_path / "map.yaml"
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(BadFile, match=complaint) as caught:
        read_ros_map(tmp_path, "map.yaml")
    assert (caught.value.path, caught.value.key) == (str(path), key)
    assert caught.value.line is not None


def test_a_link_does_not_lead_out_of_the_worlds_folder(tmp_path: Path) -> None:
    inner = tmp_path / "world"
    inner.mkdir()
    write_ros_map(inner, "#.")
    (inner / "map.pgm").rename(tmp_path / "map.pgm")
    (inner / "map.pgm").symlink_to(tmp_path / "map.pgm")
    with pytest.raises(BadFile, match="outside the world's folder"):
        read_ros_map(inner, "map.yaml")


OCTILE = "type octile\nheight 2\nwidth 4\nmap\n.GS@\nOTW.\n"


def test_an_octile_map_has_its_first_row_in_the_north(tmp_path: Path) -> None:
    (tmp_path / "a.map").write_text(OCTILE.replace("\n", "\r\n"))
    cells, _ = read_movingai_map(tmp_path, "a.map", 0.5)
    assert_array_equal(cells.occupied, [[True, True, True, False], [False, False, False, True]])
    assert cells.size_m == (2.0, 1.0)


@pytest.mark.parametrize(("old", "new", "line", "complaint"), [
    ("octile", "tile", 1, "expected 'type octile'"), ("height 2", "height two", 2, "an integer each"),
    ("width 4", "height 4", 3, "each once"), ("height 2", "height 3", 6, "expected 3 rows"),
    (".GS@", ".GS", 5, "expected 4 cells, as 'width' says, found 3"),
    ("OTW.", "OTWx", 6, "column 4: 'x' is no terrain"),
    ("map\n", "", 4, "expected 'map'"), ("height 2", "height 99999999", 2, "at most 16000000")])
def test_an_error_in_an_octile_map_names_its_line(tmp_path: Path, old: str, new: str, line: int, complaint: str
                                                   ) -> None:
    (tmp_path / "a.map").write_text(OCTILE.replace(old, new))
    with pytest.raises(BadFile, match=complaint) as caught:
        read_movingai_map(tmp_path, "a.map", 1.0)
    assert caught.value.line == line


def test_a_large_map_is_read_in_memory_in_proportion_to_its_area(tmp_path: Path) -> None:
    write_pgm(tmp_path / "map.pgm", np.full((2000, 2000), 254))
    (tmp_path / "map.yaml").write_text(YAML.format(image="map.pgm", resolution=0.05, origin="[0, 0, 0]"))
    cells, _ = read_ros_map(tmp_path, "map.yaml")
    assert not cells.occupied.any()
