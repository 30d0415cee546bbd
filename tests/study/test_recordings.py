"""Which trials a run records, and replays: each is the trial that its rows are of, bit for bit."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from rerun.chunk import RrdReader

from sva_bench.choices import Fidelity, Interaction, News, PolicyName, RecordedKind
from sva_bench.errors import BadInput
from sva_bench.execution.executed import Executed
from sva_bench.recording.rerun import TIMELINE
from sva_bench.storage.stored_run import rows_of_trial
from sva_bench.study.options import Options
from sva_bench.study.recordings import Ask, asks_of, typical_trial
from sva_bench.study.replay import Wanted, replay
from sva_bench.study.run import Measured, measure, publish_run
from sva_bench.world.model import World
from tests.worlds_for_tests import SMALL, world_of

TRIALS = 24
SCENARIOS = ("half", "safe")
INTERACTIONS: tuple[Interaction, ...] = ("independent", "shared", "uncoordinated")
FIDELITIES: tuple[Fidelity, ...] = ("kinematic", "rollout", "physics")
REACTIONS: tuple[tuple[PolicyName, News], ...] = (
    ("none", "never"), ("resolve", "station"), ("resolve", "report"), ("resolve", "instant"))


def quiet(*_: object) -> None:
    """Nobody follows."""


def of_kind(folder: Path, interaction: Interaction) -> World:
    text = SMALL.replace("noise:", f"interaction: {interaction}\nnoise:").replace("  safe: {uv2: 1.0}\n", "")
    return world_of(folder, text)


@pytest.mark.spread(1)
@pytest.mark.parametrize(("interaction", "fidelity"), [
    pytest.param(interaction, fidelity,
                 marks=[pytest.mark.long] * (fidelity == "physics" or interaction == "uncoordinated"))
    for interaction in INTERACTIONS for fidelity in FIDELITIES])
def test_a_trial_that_is_replayed_gives_its_rows_again(interaction: Interaction, fidelity: Fidelity, tmp_path: Path
                                                       ) -> None:
    world = of_kind(tmp_path, interaction)
    trials = 4 if fidelity == "physics" else TRIALS
    # Random trials, of numbers that differ from case to case.
    rng = np.random.default_rng([INTERACTIONS.index(interaction), FIDELITIES.index(fidelity)])
    options = Options(trials=trials, rollouts=3, fidelity=fidelity, policies=("none", "resolve"),
                      news=("station", "report", "instant"))
    run = publish_run(world, options, measure(world, options, None, quiet), tmp_path / "runs", quiet)
    rows = pq.read_table(run.folder / "outcomes.parquet").select(["policy", "news", "trial"]).to_pylist()
    for policy, news in REACTIONS:
        known = sorted({row["trial"] for row in rows if (row["policy"], row["news"]) == (policy, news)})
        for trial in rng.choice(known, 2, replace=False).tolist():
            again = replay(run.folder, Wanted(scenario="half", trial=trial, policy=policy, news=news), None, quiet)
            assert [one.case.planner for one in again] == ["stochastic", "deterministic"]
            for one in again:
                assert one.rows == rows_of_trial(run.folder / "outcomes.parquet", one.case.key, trial)
                assert one.recording is not None
                assert told(one.recording)["trial"] == trial


@pytest.mark.spread(1)
@pytest.mark.parametrize(("policy", "news"), [("none", "never"), ("resolve", "report")])
def test_the_worst_and_the_median_trial_of_a_plan_are_those_of_its_rows(policy: PolicyName, news: News, tmp_path: Path
                                                                        ) -> None:
    world = of_kind(tmp_path, "independent")
    options = Options(trials=12, rollouts=3, fidelity="kinematic", policies=("none", "resolve"), news=("report",))
    run = publish_run(world, options, measure(world, options, None, quiet), tmp_path / "runs", quiet)
    rows = [row for row in pq.read_table(run.folder / "outcomes.parquet").to_pylist() if row["policy"] == policy]
    for planner in ("stochastic", "deterministic"):
        mine = [row for row in rows if row["planner"] == planner]
        weight = {row["trial"]: row["weight"] for row in mine}
        value = {trial: sum(row["value"] for row in mine if row["trial"] == trial) for trial in weight}
        worst, median = (value[replayed(run.folder, planner, policy, news, kind)] for kind in WORST_AND_MEDIAN)
        assert worst == min(value.values())
        # At most half of the probability lies below the median, and at most half above.
        for beyond in ([t for t in value if value[t] < median], [t for t in value if value[t] > median]):
            assert sum(weight[trial] for trial in beyond) <= 0.5 * sum(weight.values()) + 1e-9


WORST_AND_MEDIAN: tuple[RecordedKind, ...] = ("worst", "median")


def replayed(folder: Path, planner: str, policy: PolicyName, news: News, kind: RecordedKind) -> int:
    """The trial that is played again and recorded as the worst, or the median one."""
    (one,) = replay(folder, Wanted(scenario="half", planner=planner, policy=policy, news=news, kind=kind), None, quiet)
    assert one.recording is not None
    assert one.recording.stem.endswith(kind)
    assert told(one.recording)["chosen"] == kind
    return int(one.rows[0]["trial"])


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> tuple[World, Options, Measured]:
    world = world_of(tmp_path_factory.mktemp("world"))
    options = Options(trials=TRIALS, rollouts=4, fidelity="kinematic", record=asks_of(
        ["half:17,worst", "median"], SCENARIOS, TRIALS))
    return world, options, measure(world, options, None, quiet)


@pytest.fixture(scope="module")
def folder(measured: tuple[World, Options, Measured], tmp_path_factory: pytest.TempPathFactory) -> Path:
    world, options, done = measured
    return publish_run(world, options, done, tmp_path_factory.mktemp("runs"), quiet).folder


def told(path: Path) -> dict[str, Any]:
    """The properties of a recording."""
    return {column.removeprefix("property:"): batch.column(column)[0].as_py()[0]
            for chunk in RrdReader(path).stream() if chunk.entity_path == "/__properties/mission"
            for batch in [chunk.to_record_batch()] for column in batch.schema.names if column != "rerun.controls.RowId"}


def runs_of(done: Measured, scenario: str) -> list[Executed]:
    return [run for run in done.executed if run.case.scenario.name == scenario]


def test_a_typical_trial_ends_as_most_do_with_the_median_of_their_value(
        measured: tuple[World, Options, Measured]) -> None:
    for scenario in SCENARIOS:
        runs = runs_of(measured[2], scenario)
        ends = [tuple(tuple(run.end[trial].tolist()) for run in runs) for trial in range(TRIALS)]
        most = max(ends.count(course) for course in ends)
        chosen = typical_trial(runs)
        assert ends.count(ends[chosen]) == most
        values = sorted(sum(float(run.value[trial].sum()) for run in runs)
                        for trial in range(TRIALS) if ends[trial] == ends[chosen])
        mine = sum(float(run.value[chosen].sum()) for run in runs)
        assert mine == pytest.approx(values[(len(values) - 1) // 2])


def test_a_run_records_a_typical_trial_of_each_plan_what_is_asked_for_and_plans_that_differ_side_by_side(
        folder: Path, measured: tuple[World, Options, Measured]) -> None:
    notes = json.loads((folder / "manifest.json").read_text())["recordings"]
    assert {note["file"] for note in notes} == {path.name for path in (folder / "recordings").iterdir()}
    for scenario in SCENARIOS:
        typical = typical_trial(runs_of(measured[2], scenario))
        for run in runs_of(measured[2], scenario):
            stem, value = f"{scenario}-{run.case.planner}", run.value.sum(axis=1)
            by_file = {note["file"]: note for note in notes}
            assert by_file[f"{stem}.rrd"]["trial"] == typical
            assert value[by_file[f"{stem}+worst.rrd"]["trial"]] == value.min()
            assert value[by_file[f"{stem}+median.rrd"]["trial"]] == np.sort(value)[(TRIALS - 1) // 2]
            assert (f"{stem}+trial17.rrd" in by_file) == (scenario == "half")
            for file, note in by_file.items():
                if file.partition("+")[0].removesuffix(".rrd") == stem:
                    has = told(folder / "recordings" / file)
                    assert (has["scenario"], has["planner"], has["trial"], has["chosen"], has["seed"]) == (
                        scenario, run.case.planner, note["trial"], note["chosen"], 0)
                    assert has["value"] == pytest.approx(float(value[note["trial"]]))
    assert "half+compare.rrd" in {note["file"] for note in notes}
    assert "safe+compare.rrd" not in {note["file"] for note in notes}  # where nobody fails it is the same plan


def test_what_is_recorded_is_what_the_rows_of_the_trial_say(folder: Path) -> None:
    for note in json.loads((folder / "manifest.json").read_text())["recordings"]:
        for planner in note["planners"]:
            below = "" if len(note["planners"]) == 1 else f"{planner}/"
            rows = rows_of_trial(folder / "outcomes.parquet", (note["scenario"], planner, "none", "never"),
                                 note["trial"])
            for row in rows:
                series = column(folder / "recordings" / note["file"], f"{below}collected/{row['robot']}",
                                "Scalars:scalars")
                assert series[-1] == pytest.approx([row["incentive"]])
                lane = column(folder / "recordings" / note["file"], f"{below}states/{row['robot']}",
                              "StateChange:state")
                stays = row["stops_reached"] == 0 and row["end"] == "home"
                assert lane[-1] == ["at the base" if stays else {
                    "home": "home", "failed": "failed", "late": "home late", "out_of_fuel": "out of fuel",
                    "stuck": "stuck"}[row["end"]]]


def column(path: Path, entity: str, component: str) -> list[Any]:
    return [value for chunk in RrdReader(path).stream()
            if chunk.entity_path == f"/{entity}" and TIMELINE in chunk.timeline_names
            for batch in [chunk.to_record_batch()] if component in batch.schema.names
            for value in batch.column(component).to_pylist()]


def test_results_do_not_depend_on_what_is_recorded(folder: Path, measured: tuple[World, Options, Measured],
                                                   tmp_path: Path) -> None:
    world = measured[0]
    plain = Options(trials=TRIALS, rollouts=4, fidelity="kinematic")
    other = publish_run(world, plain, measure(world, plain, None, quiet), tmp_path, quiet).folder
    assert other.name == folder.name
    for name in ("outcomes.parquet", "legs.parquet", "summary.json"):
        assert (other / name).read_bytes() == (folder / name).read_bytes()


@pytest.mark.parametrize(("words", "asks"), [
    ((), ()),
    (["half:17"], [Ask(kind="trial", scenario="half", trial=17)]),
    (["3,safe:worst"], [Ask(kind="trial", trial=3), Ask(kind="worst", scenario="safe")]),
    (["median", " typical "], [Ask(kind="median"), Ask(kind="typical")]),
    (["0"], [Ask(kind="trial", trial=0)]),
])
def test_recordings_are_asked_for_by_number_or_by_what_is_special_of_a_trial(
        words: Sequence[str], asks: Sequence[Ask]) -> None:
    assert asks_of(words, SCENARIOS, TRIALS) == tuple(asks)


@pytest.mark.parametrize(("word", "said"), [
    ("S9:1", "there is no scenario"), ("haf:1", "did you mean 'half'"), ("half:24", "the first is 0, the last 23"),
    ("999999999999999999999999", "the last 23"), ("-1", "expected a trial's number"), ("half:-1", "expected"),
    ("1.5", "expected"), ("half:", "expected"), (":3", "expected"), ("", "expected"), ("worst,", "expected"),
    ("best", "expected"), ("half:worst:1", "there is no scenario"), ("²", "expected"), ("worst,worst", "given twice"),
    ("half:\x1b[31m", "expected"), ("1,1", "given twice"),
])
def test_what_is_no_recording_is_refused(word: str, said: str) -> None:
    with pytest.raises(BadInput) as error:
        asks_of([word], SCENARIOS, TRIALS)
    assert str(error.value).startswith("--record ")
    assert said in str(error.value)
    assert "\x1b" not in str(error.value)
