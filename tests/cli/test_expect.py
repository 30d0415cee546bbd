"""``sva-bench expect``: lines, exit codes, the JUnit report, and refusals."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from tests.commands_for_tests import sva_bench
from tests.worlds_for_tests import SMALL


def expect(*arguments: object) -> subprocess.CompletedProcess[str]:
    return sva_bench("expect", *arguments, cwd=Path.cwd())


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A run and a batch."""
    folder = tmp_path_factory.mktemp("run")
    (folder / "small.yaml").write_text(SMALL, encoding="utf-8")
    for command in (["run", "small.yaml"], ["batch", "small.yaml", "--out", "b"]):
        done = sva_bench(*command, "--trials", 20, "--rollouts", 1, "--fidelity", "kinematic", "--workers", 1,
                         cwd=folder)
        assert done.returncode == 0, done.stderr
    (run,) = (folder / "runs").iterdir()
    return run, folder / "b"


def test_each_expectation_has_a_line_and_those_not_met_an_exit_code(folders: tuple[Path, Path], tmp_path: Path) -> None:
    run, _ = folders
    junit = tmp_path / "report.xml"
    done = expect(run, "trials == 20", "half.vss.executed.mean > 1e6", "--junit", junit)
    assert done.returncode == 5
    first, second = done.stdout.splitlines()
    assert first == "ok      trials == 20: found 20"
    assert second.startswith("NOT MET half.vss.executed.mean > 1e6: found ")
    (suite,) = ET.parse(junit).getroot()
    assert (suite.get("name"), suite.get("tests"), suite.get("failures")) == ("small", "2", "1")
    assert [case.find("failure") is not None for case in suite] == [False, True]
    assert expect(run, "trials == 20").returncode == 0


def test_a_batch_is_judged_by_its_figures_over_maps(folders: tuple[Path, Path]) -> None:
    _, batch = folders
    done = expect(batch, "half.maps == 1", "half.vss.mean >= -1e6", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["met"]


@pytest.mark.spread(2)
@pytest.mark.parametrize(("arguments", "said"), [
    (["half.vss.executed.mea > 0"], "did you mean 'mean'?"),
    (["half.vss"], "expected PATH OPERATOR VALUE"),
    ([""], "its value is empty"),
    ([], "EXPRESSION"),
    (["trials == 20", "--junit", "/no/such/folder/x.xml"], "there is no such folder"),
])
def test_what_can_not_be_judged_is_one_error(folders: tuple[Path, Path], arguments: list[str], said: str) -> None:
    done = expect(folders[0], *arguments)
    assert done.returncode == 2
    assert said in done.stderr
    assert "Traceback" not in done.stderr


def test_a_junit_report_does_not_replace_the_summary(folders: tuple[Path, Path]) -> None:
    done = expect(folders[0], "trials == 20", "--junit", folders[0] / "summary.json")
    assert done.returncode == 2
    assert "would be lost" in done.stderr
