"""Recordings of a run, by scenario and planner; names that could be taken for one another among them."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sva_bench.__main__ import run_command_line
from sva_bench.errors import BadInput
from sva_bench.storage.recordings import most_telling, recordings_for
from sva_bench.storage.trial_choice import choice_of, nearest_to_median
from tests.commands_for_tests import sva_bench
from tests.worlds_for_tests import SMALL

WORLD = SMALL.replace("half: {uv2: 0.5}", "S: {uv2: 0.5}").replace("safe: {uv2: 1.0}", "S-stochastic: {uv2: 1.0}")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    (folder / "small.yaml").write_text(WORLD, encoding="utf-8")
    done = sva_bench("run", "small.yaml", "--trials", 10, "--rollouts", 1, "--fidelity", "kinematic", "--workers", 1,
                     cwd=folder)
    assert done.returncode == 0, done.stderr
    (found,) = (folder / "runs").iterdir()
    (found / "recordings" / "S-stochastic+trial7.rrd").write_bytes(b"")  # as replay names what it records
    return found


@pytest.mark.parametrize(("scenario", "planner", "stems"), [
    ("S", None, ["S+compare", "S-stochastic", "S-stochastic+trial7", "S-deterministic"]),
    ("S", "stochastic", ["S-stochastic", "S-stochastic+trial7"]),
    ("S-stochastic", None, ["S-stochastic-stochastic", "S-stochastic-deterministic"]),
    (None, "deterministic", ["S-deterministic", "S-stochastic-deterministic"]),
])
def test_recordings_are_found_by_scenario_and_planner_the_most_telling_first(
        run: Path, scenario: str | None, planner: str | None, stems: list[str]) -> None:
    assert [path.stem for path in recordings_for(run, scenario, planner)] == stems


@pytest.mark.parametrize(("word", "stems"), [
    ("7", ["S-stochastic+trial7"]),
    ("typical", ["S+compare", "S-stochastic", "S-deterministic"]),
    ("median", ["S-stochastic+resolve-report-median"]),
    ("worst", ["S-stochastic+worst", "S-deterministic+worst"]),
])
def test_recordings_are_found_by_their_trial(run: Path, word: str, stems: list[str]) -> None:
    extra = [run / "recordings" / f"{stem}.rrd" for stem in (
        "S-stochastic+worst", "S-deterministic+worst", "S-stochastic+resolve-report-median")]
    for path in extra:
        path.write_bytes(b"")
    try:
        assert [path.stem for path in recordings_for(run, "S", None, choice_of(word))] == stems
    finally:
        for path in extra:
            path.unlink()


def test_the_trial_that_the_manifest_names_is_found_by_its_number(run: Path) -> None:
    notes = json.loads((run / "manifest.json").read_text())["recordings"]
    (trial,) = {note["trial"] for note in notes if note["scenario"] == "S"}
    found = recordings_for(run, "S", None, choice_of(str(trial)))
    assert [path.stem for path in found] == ["S+compare", "S-stochastic", "S-deterministic"]


@pytest.mark.long
def test_a_trial_that_was_not_recorded_is_played_again_to_be_seen(run: Path, tmp_path: Path) -> None:
    assert recordings_for(run, None, "stochastic", choice_of("median")) == ()
    video = tmp_path / "median.gif"
    before = set((run / "recordings").iterdir())
    for _ in range(2):  # the second time it is there
        assert run_command_line(["view", str(run), "--planner", "stochastic", "--trial", "median", "--video",
                                 str(video)]) == 0
        assert video.stat().st_size > 1000
        (new,) = set((run / "recordings").iterdir()) - before
        assert new.stem == f"{most_telling(run)}-stochastic+median"
    new.unlink()
    assert run_command_line(["view", str(run), "--scenario", "S", "--trial", "99", "--video", str(video)]) == 2


@pytest.mark.parametrize(("word", "said"), [
    ("wrost", "did you mean 'worst'?"), ("-1", "from 0 on"), ("1.5", "from 0 on"), ("", "typical, median or worst"),
    ("9" * 13, "from 0 on")])
def test_no_other_words_stand_for_a_trial(word: str, said: str) -> None:
    with pytest.raises(BadInput) as error:
        choice_of(word)
    assert said in str(error.value)


def test_the_median_counts_each_trial_by_its_weight() -> None:
    value = np.array([5.0, 1.0, 3.0, 3.0])
    assert nearest_to_median(value).tolist() == [2, 3]
    assert nearest_to_median(value[:2]).tolist() == [1]  # of two in the middle the lower one
    assert nearest_to_median(value, np.array([0.6, 0.2, 0.1, 0.1])).tolist() == [0]


@pytest.mark.parametrize(("scenario", "planner", "said"), [
    ("T", None, "--scenario 'T': the run has none of that name"),
    (None, "stochastc", "did you mean 'stochastic'"),
])
def test_what_the_run_does_not_have_is_refused(run: Path, scenario: str | None, planner: str | None, said: str) -> None:
    with pytest.raises(BadInput) as error:
        recordings_for(run, scenario, planner)
    assert said in str(error.value)


def test_a_plan_without_a_recording_says_how_to_get_one(run: Path) -> None:
    path = run / "recordings" / "S-deterministic.rrd"
    path.rename(run / "moved")
    try:
        with pytest.raises(BadInput, match="replay"):
            recordings_for(run, "S", "deterministic")
    finally:
        (run / "moved").rename(path)


def test_one_recording_is_not_chosen_from(run: Path) -> None:
    done = subprocess.run([sys.executable, "-m", "sva_bench", "view", str(run / "recordings" / "S-deterministic.rrd"),
                           "--scenario", "S", "--web"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "is one recording" in done.stderr
