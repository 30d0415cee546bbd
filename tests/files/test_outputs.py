"""Where results go: readers who have gone, outputs that are closed or full, places that take nothing."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from PIL import Image

from sva_bench.__main__ import run_command_line
from sva_bench.errors import BadInput
from sva_bench.files.outputs import check_folder, check_output
from tests.cli.test_commands import TINY
from tests.commands_for_tests import sva_bench
from tests.world.test_map_worlds import two_rooms
from tests.worlds_for_tests import SMALL

SVA_BENCH = f"{sys.executable} -m sva_bench"


def shell(line: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """A line typed into a shell, with ``sva-bench`` in it; the exit code is that of the line's first command."""
    typed = line.replace("sva-bench", SVA_BENCH)
    return subprocess.run(["bash", "-c", f"{typed}; exit ${{PIPESTATUS[0]}}"], cwd=folder, text=True,
                          capture_output=True, timeout=300, check=False)


@pytest.mark.spread(3)
@pytest.mark.parametrize(("line", "said"), [
    ("sva-bench world schema | head -1", ""),  # more than a pipe holds
    ("sva-bench plan tiny.json | true", "optimal"),
    ("sva-bench instance random --pois 3 -o made.json >&- 2>&- <&-", ""),
    ("sva-bench --help | head -1", ""),
    ("sva-bench --help | true", ""),
    ("sva-bench certify tiny.json plan.json | true", ""),
    ("sva-bench --help >&-", ""),
    ("sva-bench instance random --pois 3 -o made.json >&-", ""),
    ("sva-bench instance random --pois 3 -o made.json 2>&-", "")])
def test_a_closed_pipe_neither_ends_the_command_nor_gives_a_message(line: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "tiny.json").write_text(TINY.replace('"fuel_capacity_s": 10', '"fuel_capacity_s": 11'))
    (tmp_path / "plan.json").write_text('{"format": "sva-bench/plan@1", "routes": {"uv1": ["base", "p1", "base"]}}')
    done = shell(line, tmp_path)
    assert done.returncode == 0, done.stderr
    assert not [word for word in ("fault", "error", "Traceback", "Exception", "Errno") if word in done.stderr]
    assert said in done.stderr
    if "-o" in line:  # the work is done all the same
        assert json.loads((tmp_path / "made.json").read_text())["format"] == "sva-bench/instance@1"


@pytest.mark.long
def test_a_run_into_a_closed_pipe_still_prints_its_folder(tmp_path: Path) -> None:
    (tmp_path / "small.yaml").write_text(SMALL, encoding="utf-8")
    done = shell("sva-bench run small.yaml --trials 5 --fidelity kinematic --workers 1 | true", tmp_path)
    assert done.returncode == 0, done.stderr
    assert "written to runs/small-seed0-" in done.stderr


@pytest.mark.spread(1)
@pytest.mark.parametrize("line", ["sva-bench certify tiny.json plan.json", "sva-bench --help",
                                         "sva-bench world schema"])
def test_results_lost_to_a_full_disk_exit_with_code_two(line: str, tmp_path: Path) -> None:
    (tmp_path / "tiny.json").write_text(TINY.replace('"fuel_capacity_s": 10', '"fuel_capacity_s": 11'))
    (tmp_path / "plan.json").write_text('{"format": "sva-bench/plan@1", "routes": {"uv1": ["base", "p1", "base"]}}')
    done = shell(f"{line} > /dev/full", tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("error:") == 1
    assert "standard output cannot be written to (No space left on device)" in done.stderr


@pytest.mark.spread(3)
@pytest.mark.parametrize("line", [
    "plan tiny.json", "run small.yaml --json", "batch small.yaml --dry-run",
    "plan tiny.json -o -", "times small.yaml", "instance random", "world random", "world schema", "reproduce rewards",
    "certify tiny.json plan.json --json", "certify tiny.json plan.json", "world check small.yaml",
    "world example --list", "batch status .", "batch small.yaml --json"])
def test_a_result_that_a_closed_output_would_lose_is_refused_before_any_work(line: str, tmp_path: Path) -> None:
    (tmp_path / "tiny.json").write_text(TINY)
    (tmp_path / "small.yaml").write_text(SMALL, encoding="utf-8")
    (tmp_path / "plan.json").write_text('{"format": "sva-bench/plan@1", "routes": {"uv1": ["base", "p1", "base"]}}')
    done = shell(f"sva-bench {line} >&-", tmp_path)
    assert done.returncode == 2
    assert "standard output is closed, and the result would be lost; " in done.stderr
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1  # and nothing before it
    assert not (tmp_path / "runs").exists()


def test_the_plan_of_a_closed_error_output_is_not_written_into_a_file_that_was_opened_later(tmp_path: Path) -> None:
    # Descriptor 2 is free then, and the next file that is opened gets it.
    (tmp_path / "tiny.json").write_text(TINY)
    done = shell("sva-bench plan tiny.json -o plan.json >&- 2>&- <&-", tmp_path)
    assert done.returncode == 0
    assert json.loads((tmp_path / "plan.json").read_text())["format"] == "sva-bench/plan@1"


def test_a_dash_is_standard_output(tmp_path: Path) -> None:
    (tmp_path / "tiny.json").write_text(TINY)
    done = sva_bench("plan", "tiny.json", "-o", "-", cwd=tmp_path)
    assert json.loads(done.stdout)["format"] == "sva-bench/plan@1"
    assert [path.name for path in tmp_path.iterdir()] == ["tiny.json"]


COMMANDS = [
    ("times", "small.yaml", "-o"), ("plan", "small.yaml", "-o"), ("instance", "random", "-o"),
    ("world", "random", "-o"), ("world", "draw", "small.yaml", "-o"), ("world", "from-map", "map.map", "-o"),
    ("reproduce", "rewards", "-o"), ("view", "small.rrd", "--screenshot"),
]


@pytest.mark.spread(10)
@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
@pytest.mark.parametrize("place", ["/proc/x.png", "small.yaml/x.png", "missing/x.png", "folder", "/sys/x.png"])
def test_files_that_cannot_be_written_are_refused_before_any_work(
    command: tuple[str, ...], place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    place = "folder.png" if place == "folder" else place
    (tmp_path / "folder.png").mkdir()
    (tmp_path / "small.yaml").write_text(SMALL, encoding="utf-8")
    (tmp_path / "map.map").write_text("type octile\nheight 1\nwidth 1\nmap\n.\n", encoding="utf-8")
    assert run_command_line([*command, place]) == 2
    said = "".join(capsys.readouterr())
    assert said.startswith(f"error: {place}: "), said  # and nothing before it: no work was begun
    assert said.count("\n") == 1, said
    assert sorted(path.name for path in tmp_path.iterdir()) == ["folder.png", "map.map", "small.yaml"]


@pytest.mark.parametrize("command", [
    ("run", "small.yaml", "--out"), ("execute", "small.yaml", "p.json", "--out"), ("batch", "small.yaml", "--out"),
    ("batch", "small.yaml", "--out", "fine", "--cache")], ids=" ".join)
@pytest.mark.parametrize("place", ["/proc/x", "/sys/x/y", "small.yaml", "small.yaml/x", "/dev/null"])
def test_folders_that_cannot_be_written_are_refused_before_any_work(
    command: tuple[str, ...], place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.yaml").write_text(SMALL, encoding="utf-8")
    (tmp_path / "p.json").write_text('{"format": "sva-bench/plan@1", "routes": {}}')
    assert run_command_line([*command, place]) == 2
    said = "".join(capsys.readouterr())
    assert said.startswith(f"error: {place}: "), said
    assert f"choose another with {command[-1]}" in said
    assert {path.name for path in tmp_path.iterdir()} == {"small.yaml", "p.json"}


def test_a_place_that_is_fine_is_left_as_it_was(tmp_path: Path) -> None:
    check_output(tmp_path / "plan.json")
    check_folder(tmp_path / "a" / "b", "--out")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "loop").symlink_to("loop")
    with pytest.raises(BadInput):
        check_output(tmp_path / "loop" / "x")


@pytest.mark.spread(1)
@pytest.mark.parametrize(("number", "code"), [
    (signal.SIGTERM, 143), (signal.SIGHUP, 129), (signal.SIGINT, 130)])
def test_a_terminated_run_removes_its_drafts(number: signal.Signals, code: int, tmp_path: Path) -> None:
    (tmp_path / "small.yaml").write_text(SMALL, encoding="utf-8")
    process = subprocess.Popen(
        [sys.executable, "-m", "sva_bench", "run", "small.yaml", "--trials", "500", "--rollouts", "500"], cwd=tmp_path,
        stderr=subprocess.PIPE, text=True, start_new_session=True,
        preexec_fn=lambda: signal.signal(number, signal.SIG_DFL))  # ignored where tests are run with nohup
    assert process.stderr is not None
    assert process.stderr.readline() == "planning paths ...\n"
    os.kill(process.pid, number)
    said = process.communicate(timeout=120)[1]
    assert process.returncode == code, said
    assert "Traceback" not in said
    assert not list(tmp_path.glob("runs/.*"))


def test_who_ignores_hang_ups_goes_on_doing_so(tmp_path: Path) -> None:
    (tmp_path / "tiny.json").write_text(TINY)
    script = f"trap '' HUP; {SVA_BENCH} plan tiny.json -o plan.json & sleep 1; kill -HUP $!; wait $!"
    done = subprocess.run(["bash", "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_ctrl_c_is_heard_while_libraries_are_loaded(tmp_path: Path) -> None:
    # Loading is held up at the first library, as a slow disk would.
    (tmp_path / "typer.py").write_text("import time\nopen('loading', 'w').close()\ntime.sleep(60)\n")
    with subprocess.Popen([sys.executable, "-c", "from sva_bench.__main__ import main; main()"], cwd=tmp_path,
                          stderr=subprocess.PIPE, text=True,
                          env=os.environ | {"PYTHONPATH": f"{tmp_path}:{Path(__file__).parents[2]}"}) as process:
        until = time.monotonic() + 60
        while not (tmp_path / "loading").exists() and time.monotonic() < until:
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        said = process.communicate(timeout=30)[1]
    assert (process.returncode, said) == (130, "interrupted\n")


@pytest.mark.long
def test_a_picture_is_not_drawn_over_the_map_that_it_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    two_rooms(tmp_path)
    picture = Image.open("map.pgm")
    picture.save("map.png")
    text = (tmp_path / "map.yaml").read_text()
    (tmp_path / "map.yaml").write_text(text.replace("map.pgm", "map.png"))
    before = (tmp_path / "map.png").read_bytes()
    assert run_command_line(["world", "draw", "world.yaml", "-o", "map.png"]) == 2
    assert "this is what is read, and would be lost" in capsys.readouterr().err
    assert (tmp_path / "map.png").read_bytes() == before
