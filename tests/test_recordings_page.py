"""docs/recordings.md: its query runs, the entities that it lists are there, and its commands are ours."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from rerun.chunk import RrdReader

from sva_bench.choices import RobotState
from tests.commands_for_tests import sva_bench
from tests.worlds_for_tests import SMALL

PAGE = (Path(__file__).parents[1] / "docs" / "recordings.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    (folder / "small.yaml").write_text(SMALL, encoding="utf-8")
    done = sva_bench("run", "small.yaml", "--trials", "20", "--rollouts", "2", "--fidelity", "kinematic", "--workers",
                     "1", "--record", "half:3,worst", cwd=folder)
    assert done.returncode == 0, done.stderr
    (found,) = (folder / "runs").iterdir()
    return found


def test_the_query_prints_states_of_each_scenario(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(compile(code, "recordings.md", "exec"), {"run": run})
    said = capsys.readouterr().out.splitlines()
    assert [line.split(" trial")[0] for line in said if " trial " in line] == ["half", "safe"]
    assert any(re.fullmatch(r" +0\.0 s (driving|at the base)", line) for line in said)
    assert any(re.fullmatch(r" +\d+\.\d s home", line) for line in said)


def test_the_entities_that_are_listed_are_there_and_no_others(run: Path) -> None:
    listed = set()
    for row in re.findall(r"^\| (`.*?) \| `[A-Z]", PAGE.split("## What is in a file")[1].split("## ")[0], re.MULTILINE):
        listed |= set(re.findall(r"`([^`]*)`", row))
    found = {chunk.entity_path.removeprefix("/") for path in (run / "recordings").glob("*.rrd")
             for chunk in RrdReader(path).stream()}
    patterns = [re.compile(r"(?:[a-z]+/)?" + re.sub("<[a-z]+>", "[A-Za-z0-9]+", entity) + "(?:/.*)?")
                for entity in [*listed, "world/floor", "world/boxes", "world/cylinders", "__properties"]]
    unlisted = {entity for entity in found if not any(pattern.fullmatch(entity) for pattern in patterns)}
    assert unlisted <= {"world", "stochastic/world", "deterministic/world"}
    for state in RobotState.__args__:  # type: ignore[attr-defined]
        assert f"`{state}`" in PAGE


@pytest.mark.parametrize("command", [
    pytest.param(command, marks=[pytest.mark.long] * any(
        slow in command for slow in (".mp4", ".gif", "--screenshot", "--trial median"))) for command in re.findall(
        r"^\$ sva-bench ((?:view|replay|export) .*?)(?: +#.*)?$", PAGE, re.MULTILINE)])
def test_its_commands_are_understood(command: str, run: Path, tmp_path: Path) -> None:
    here = {"S3": "half", "runs/recorded/four-rooms-*": str(run)}
    words = [here.get(word, word) for word in shlex.split(command)]
    words = ["3" if before == "--trial" and word.isdigit() else word
             for before, word in zip(["", *words], words, strict=False)]
    if "--web" in words or (words[0] == "view" and not {"--video", "--screenshot"} & set(words)):
        words = [*words, "--scenario", "nobody's"]  # it would go on until it is ended
    done = sva_bench(*words, cwd=tmp_path)
    if "nobody's" in words:
        assert "the run has none of that name" in " ".join(done.stderr.split())
    elif "--screenshot" not in words:  # which needs a driver
        assert done.returncode == 0, done.stderr
