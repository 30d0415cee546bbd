"""Whatever stands in a map's files, reading them gives a map or one complaint, in little time and memory."""

from __future__ import annotations

import io
import multiprocessing
import re
import time
import warnings
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from sva_bench.errors import BadFile
from sva_bench.geometry.cells import boxes_of
from sva_bench.world.maps.images import MAX_CELLS
from sva_bench.world.maps.movingai import read_movingai_map
from sva_bench.world.maps.ros import read_ros_map
from tests.world.maps_for_tests import YAML

LONGEST_S, MOST_MB, LONGEST_COMPLAINT = 5.0, 1000, 600
OCTILE = b"type octile\nheight 3\nwidth 5\nmap\n.....\n.@@T.\nG.WS.\n"
WORDS = [b"", b"0", b"-1", b"1", b"99999", b"123456789", b"9" * 30, b"1e9", b"1e-9", b"nan", b".inf", b"[", b"{", b"]",
         b"\x00", b"\xff", b"\n", b" ", b"#", b"&a", b"*a", b"!!x", b"null", b"true", b"P2", b"P5", b"P6", b"P1", b"Pf",
         b"@", b"../x", b"/dev/zero", b"map.yaml", b"raw", b"scale", b"255", b"65535", b"\x7f\xff\xff\xff"]


def pictures() -> list[bytes]:
    """A small map in each format."""
    grey = Image.fromarray(np.random.default_rng(0).choice([0, 205, 254], (6, 7)).astype(np.uint8))
    found = [b"P2\n7 2\n255\n" + b" ".join(b"%d" % k for k in range(14)) + b"\n", b"P1\n3 2\n0 1 0 1 1 0\n",
             b"P5\n2 2\n65535\n" + bytes(range(8)), b"Pf\n2 2\n-1.0\n" + bytes(16)]
    for mode, kind in (("L", "PPM"), ("RGB", "PPM"), ("L", "PNG"), ("RGBA", "PNG"), ("P", "PNG"), ("1", "PNG"),
                       ("L", "BMP"), ("RGB", "BMP"), ("P", "BMP")):
        with io.BytesIO() as out:
            grey.convert(mode).save(out, kind)
            found.append(out.getvalue())
    return found


def spoilt(content: bytes, rng: np.random.Generator) -> bytes:
    """The content with a few bytes changed, cut out, doubled, or words put in; mostly near its beginning."""
    data = bytearray(content)
    for _ in range(int(rng.integers(1, 5))):
        reach = len(data) if rng.random() < 0.4 else min(len(data), 40)
        at = int(rng.integers(0, reach + 1))
        match int(rng.integers(0, 5)):
            case 0:
                data[at:at + 1] = bytes([int(rng.integers(0, 256))])
            case 1:
                data[at:at + int(rng.integers(1, 12))] = b""
            case 2:
                data[at:at + int(rng.integers(0, 5))] = WORDS[int(rng.integers(len(WORDS)))]
            case 3:
                data[at:at] = data[at:at + int(rng.integers(1, 30))]
            case _:
                data = data[:at] if rng.random() < 0.3 else data
    return bytes(data)


def read_spoilt(folder: str, seed: int, rounds: int) -> tuple[int, int, float, int]:
    """Read many spoilt maps; how many were good and bad, the longest time [s], and the most memory [MB]."""
    rng, good, bad, longest = np.random.default_rng(seed), 0, 0, 0.0
    images = pictures()
    warnings.simplefilter("error")  # nothing is printed past our own messages
    for _ in range(rounds):
        kind = int(rng.integers(0, 3))
        image = images[int(rng.integers(len(images)))]
        text = YAML.format(image="map.pgm", resolution=0.05, origin="[-1, 2.5, 0.3]").encode() + b"mode: trinary\n"
        Path(folder, "map.pgm").write_bytes(spoilt(image, rng) if kind == 0 else image)
        Path(folder, "map.yaml").write_bytes(spoilt(text, rng) if kind == 1 else text)
        Path(folder, "a.map").write_bytes(spoilt(OCTILE, rng))
        begun = time.monotonic()
        try:
            cells, files = (read_movingai_map(Path(folder), "a.map", 1.0) if kind == 2
                            else read_ros_map(Path(folder), "map.yaml"))
        except BadFile as error:
            bad += 1
            text_of = str(error).replace(folder, "")
            assert 10 < len(text_of) < LONGEST_COMPLAINT, text_of
            assert "\n" not in text_of, text_of
        else:
            good += 1
            assert 0 < cells.occupied.size <= MAX_CELLS
            assert files
            if cells.occupied.size < 1e6:
                assert np.isfinite(boxes_of(cells)).all()
        longest = max(longest, time.monotonic() - begun)
    return good, bad, longest, most_memory_mb()


def most_memory_mb() -> int:
    """Most memory that this process ever had; ``ru_maxrss`` would count that of the process it was started by, too."""
    told = re.search(r"^VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text(), re.MULTILINE)
    assert told is not None
    return int(told[1]) // 1024


@pytest.mark.parametrize(("seed", "rounds"), [(0, 300), pytest.param(1, 6000, marks=pytest.mark.long)])
def test_spoilt_maps_end_in_a_map_or_one_complaint_in_little_time_and_memory(tmp_path: Path, seed: int, rounds: int
                                                                             ) -> None:
    # A process of its own: its memory is that of reading maps alone.
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as fresh:
        good, bad, longest, most = fresh.submit(read_spoilt, str(tmp_path), seed, rounds).result()
    assert good > rounds / 20
    assert bad > rounds / 20
    assert longest < LONGEST_S
    assert most < MOST_MB
