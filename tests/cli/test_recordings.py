"""Commands about recordings: what they refuse, and with which words."""

from __future__ import annotations

from pathlib import Path

import pytest

from sva_bench.__main__ import run_command_line
from tests.worlds_for_tests import SMALL

SHORT = ("--trials", "20", "--rollouts", "2", "--fidelity", "kinematic", "--workers", "1")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    (folder / "small.yaml").write_text(SMALL, encoding="utf-8")
    assert run_command_line(["run", str(folder / "small.yaml"), "--out", str(folder / "runs"), *SHORT]) == 0
    (found,) = (folder / "runs").iterdir()
    return found


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """What a command says when it exits with 2."""
    capsys.readouterr()
    assert run_command_line(list(arguments)) == 2
    said = capsys.readouterr()
    assert said.out == ""
    return " ".join(said.err.split())


@pytest.mark.parametrize(("word", "told"), [
    ("S9:1", "there is no scenario 'S9'; known: half, safe"), ("half:20", "the first is 0, the last 19"),
    ("-1", "expected a trial's number"), ("best", "expected a trial's number"), ("", "its value is empty"),
])
@pytest.mark.parametrize("command", ["run", "execute"])
def test_a_recording_that_cannot_be_is_refused_before_anything_is_done(
        command: str, word: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "small.yaml").write_text(SMALL, encoding="utf-8")
    (tmp_path / "mine.json").write_text('{"format": "sva-bench/plan@1", "routes": {}}')
    plans = [str(tmp_path / "mine.json")] if command == "execute" else []
    assert told in refused(capsys, command, str(tmp_path / "small.yaml"), *plans, *SHORT, f"--record={word}", "--out",
                           str(tmp_path / "runs"))
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(("arguments", "told"), [
    (("--video", "a.avi"), "let its name end in .gif or .mp4"),
    (("--video", "no/such/folder/a.gif"), "there is no such folder; choose another place with --video"),
    (("--video", "a.gif", "--web"), "leave out --web, --screenshot and --at"),
    (("--video", "a.gif", "--at", "3"), "leave out --web, --screenshot and --at"),
    (("--video", "a.gif", "--screenshot", "a.png"), "leave out --web, --screenshot and --at"),
    (("--video", "a.gif", "--scenario", "S9"), "the run has none of that name"),
])
def test_a_video_that_cannot_be_is_refused(arguments: tuple[str, ...], told: str, run: Path, tmp_path: Path,
                                           monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    assert told in refused(capsys, "view", str(run), *arguments)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("arguments", "told"), [
    ((), "say which with --trial"),
    (("--trial", "-1"), "expected a trial's number, from 0 on, or typical, median or worst"),
    (("--trial", "20", "--scenario", "half"), "no such trial; the first is 0, the last 19"),
    (("--trial", "1"), "the run has several"),
    (("--trial", "1", "--scenario", "S9"), "the run has none of that name"),
    (("--trial", "1", "--scenario", "half", "--planner", "mine"), "the run has none of that name"),
    (("--trial", "1", "--scenario", "half", "--policy", "resolve"), "the run measured no such reaction"),
    (("--trial", "1", "--scenario", "half", "--robot", "uv1"), "a bag holds all robots"),
    (("--trial", "1", "--scenario", "half", "--world", "small.yaml"), "has no use for --world"),
    (("--trial", "1", "--scenario", "half", "-o", "no/such/folder/t.mcap"), "there is no such folder"),
])
def test_a_bag_that_cannot_be_is_refused(arguments: tuple[str, ...], told: str, run: Path, tmp_path: Path,
                                         monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    output = () if "-o" in arguments else ("-o", "t.mcap")
    assert told in refused(capsys, "export", str(run), "--to", "mcap", *output, *arguments)
    assert not list(tmp_path.iterdir())


def test_a_plan_and_a_trial_are_told_apart(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan = run / "plans" / "half-stochastic.json"
    assert "name its file with --world" in refused(capsys, "export", str(plan), "--to", "csv")
    assert "has no use for --trial" in refused(capsys, "export", str(plan), "--to", "csv", "--trial", "1")
    assert "no folder; name a run folder" in refused(
        capsys, "export", str(plan), "--to", "mcap", "--trial", "1", "-o", str(tmp_path / "t.mcap"))
