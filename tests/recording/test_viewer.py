from __future__ import annotations

import html
import os
import pickle
import re
import shutil
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from urllib.error import HTTPError
from urllib.parse import parse_qs, quote, urlsplit
from urllib.request import urlopen

import pytest

from sva_bench.errors import BadFile, BadInput
from sva_bench.recording import viewer
from sva_bench.recording.record import record
from sva_bench.recording.viewer import LAVAPIPE, NoVulkanDriver, ViewerFailed, drawing_environment, recordings_of, view
from tests.recording.missions import WORLD, trace


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recording") / "S1-stochastic.rrd"
    record(path, WORLD, [trace("uv1"), trace("uv2", fails_before=2)], title="tour")
    return path


def test_a_run_folder_stands_for_its_recordings_stochastic_plans_first(tmp_path: Path) -> None:
    (tmp_path / "recordings").mkdir()
    for name in ("S1-deterministic", "S1-stochastic", "S2-deterministic", "S2-stochastic"):
        (tmp_path / "recordings" / f"{name}.rrd").touch()
    assert [file.stem for file in recordings_of(tmp_path)] == [
        "S1-stochastic", "S2-stochastic", "S1-deterministic", "S2-deterministic"]


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").touch()
    for name, words in (("", "holds no"), ("gone.rrd", "there is no"), ("notes.txt", "is no recording")):
        with pytest.raises(BadInput, match=words):
            view(recordings_of(tmp_path / name), web=False, screenshot=None, at_s=None)


def test_contradicting_options_are_refused(recording: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(BadInput, match="exclude each other"):
        view((recording,), web=True, screenshot=Path("x.png"), at_s=None)
    with pytest.raises(BadInput, match="is for a picture"):
        view((recording,), web=False, screenshot=None, at_s=3.0)
    with pytest.raises(BadInput, match=r"end in \.png"):
        view((recording,), web=False, screenshot=Path("x.jpg"), at_s=None)
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(BadInput, match="no screen"):
        view((recording,), web=False, screenshot=None, at_s=None)


def test_a_truncated_recording_is_named(recording: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.rrd"
    cut.write_bytes(recording.read_bytes()[:-2000])
    with pytest.raises(BadFile, match=r"cut\.rrd: the recording is cut off"):
        view((cut,), web=True, screenshot=None, at_s=None)


def test_the_error_of_a_missing_driver_names_its_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(NoVulkanDriver, match=r"mesa-vulkan-drivers.* VK_ICD_FILENAMES"):
        drawing_environment({"VK_ICD_FILENAMES": str(tmp_path / "gone.json")})
    driver = tmp_path / "lvp.json"
    monkeypatch.setattr(viewer, "LAVAPIPE", driver)
    monkeypatch.setattr(viewer, "_DRIVER_FOLDERS", (tmp_path,))
    with pytest.raises(NoVulkanDriver):
        drawing_environment({})
    driver.touch()
    assert drawing_environment({"A": "b"}) == {"A": "b", "VK_ICD_FILENAMES": str(driver)}
    assert drawing_environment({"VK_ICD_FILENAMES": str(driver)}) == {"VK_ICD_FILENAMES": str(driver)}


def test_errors_survive_pickling() -> None:
    for error in (NoVulkanDriver(), ViewerFailed("it burst")):
        assert str(pickle.loads(pickle.dumps(error))) == str(error)


def processes(mark: str, parent: int | None = None) -> list[Path]:
    """Folders in /proc of the viewers with the mark in their command line, if need be only those a process started."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):  # it ended meanwhile
            words = (folder / "cmdline").read_bytes().decode().split("\0")
            started_by = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
            if words[0].endswith("rerun_cli/rerun") and mark in words and parent in (None, started_by):
                found.append(folder)
    return found


def listening_addresses(process: Path) -> list[str]:
    """Local addresses on which a process listens, as the kernel writes them."""
    sockets = {os.readlink(file) for file in (process / "fd").iterdir()}
    rows = [row.split() for table in ("tcp", "tcp6") for row in (process / "net" / table).read_text().splitlines()[1:]]
    return [row[1].split(":")[0] for row in rows if row[3] == "0A" and f"socket:[{row[9]}]" in sockets]


def gone(viewer: Path) -> bool:
    """Whether a viewer, by its folder in /proc, ends within 5 s."""
    deadline = time.monotonic() + 5
    while viewer.exists() and time.monotonic() < deadline:
        time.sleep(0.02)
    return not viewer.exists()


@pytest.mark.skipif(not (LAVAPIPE.exists() or os.environ.get("VK_ICD_FILENAMES")),
                    reason="no Vulkan driver without a screen: install mesa-vulkan-drivers")
def test_a_picture_is_drawn_without_a_screen_and_no_viewer_is_left(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(viewer, "_PICTURE_SIZE", (1200, 701))
    picture = tmp_path / "picture.png"
    view((recording,), web=False, screenshot=picture, at_s=None)
    content = picture.read_bytes()
    assert content[:8] == b"\x89PNG\r\n\x1a\n"
    assert struct.unpack(">II", content[16:24]) == (1200, 701)
    assert not processes("1200x737")


def test_a_viewer_that_cannot_draw_is_a_missing_driver_and_leaves_no_picture(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "broken.json").write_text("{}")
    monkeypatch.setenv("VK_ICD_FILENAMES", str(tmp_path / "broken.json"))
    monkeypatch.setattr(viewer, "_PICTURE_SIZE", (1200, 702))
    with pytest.raises(NoVulkanDriver):
        view((recording,), web=False, screenshot=tmp_path / "picture.png", at_s=None)
    assert not (tmp_path / "picture.png").exists()
    assert not processes("1200x738")


@contextmanager
def served(*recordings: Path) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A program that shows recordings in a browser, and the address that it names."""
    program = ("import sys; from pathlib import Path; from sva_bench.recording.viewer import view;"
               "view([Path(file) for file in sys.argv[1:]], web=True, screenshot=None, at_s=None,"
               "     say=lambda text: print(text, flush=True))")
    quiet = {**os.environ, "BROWSER": "true"}  # "opens" the page without a browser
    process = subprocess.Popen([sys.executable, "-c", program, *map(str, recordings)], env=quiet,
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        assert process.stdout is not None
        said = process.stdout.readline()
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+ shows .*\n", said)  # one line, and one address in it
        yield process, said.split()[0]
    finally:
        process.kill()
        process.communicate()


@pytest.mark.skipif(shutil.which("setpriv") is None, reason="a killed program can't end its viewer without setpriv")
def test_a_served_recording_is_reachable_from_this_machine_only_and_ends_with_its_program(recording: Path) -> None:
    with served(recording) as (process, _):
        (server,) = processes("--serve-web", parent=process.pid)
        assert set(listening_addresses(server)) == {"0100007F"}  # 127.0.0.1
        assert set(listening_addresses(Path("/proc") / str(process.pid))) == {"0100007F"}
        process.kill()  # not even time to tidy up
    assert gone(server)


def test_a_browser_gets_the_viewer_and_each_recording_whole_the_first_one_first(recording: Path, tmp_path: Path
                                                                               ) -> None:
    other = tmp_path / "other<b>.rrd"
    other.write_bytes(recording.read_bytes())
    with served(recording, other) as (_, address), urlopen(address) as answer:
        page = answer.read().decode()
        assert "other&lt;b&gt;" in page
        (first,) = re.findall(r'<iframe [^>]*src="([^"]*)"', page)
        asked = parse_qs(urlsplit(html.unescape(first)).query)
        assert asked["theme"] == ["dark"]
        with urlopen(asked["url"][0]) as file:
            assert file.read() == recording.read_bytes()
            assert urlsplit(file.headers["Access-Control-Allow-Origin"]).netloc == urlsplit(first).netloc
        with urlopen(first) as viewer_page:
            assert b"wasm" in viewer_page.read()
        for missing in ("2.rrd", "..%2f..%2fetc/passwd", "-1.rrd", "1e0.rrd", "\u00b2.rrd"):
            with pytest.raises(HTTPError, match="404"):
                urlopen(f"{address}/{quote(missing, safe='%/')}")


def test_an_interrupted_viewer_ends_in_peace(recording: Path) -> None:
    with served(recording) as (process, _):
        (server,) = processes("--serve-web", parent=process.pid)
        process.send_signal(signal.SIGINT)
        assert process.wait(10) == 0
    assert gone(server)
