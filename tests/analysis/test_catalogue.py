"""One table of statistics: an entry in it is a column of terminal, page, CSV and docs, and a figure of the summary."""

from __future__ import annotations

import csv
import json
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sva_bench.analysis import catalogue
from sva_bench.analysis.catalogue import STATISTICS, Statistic, as_markdown
from sva_bench.analysis.moments import Figure, figure_of
from sva_bench.analysis.results import Distribution, Estimate, Ledger
from sva_bench.batch.tallies import figure_from, join, stored_tally, tally_from, tally_of
from sva_bench.choices import ENDS
from sva_bench.cli.tables import print_summary
from sva_bench.execution.executed import Executed
from sva_bench.files.records import as_dict
from sva_bench.report.wording import with_interval
from sva_bench.storage.stored_run import write_csv
from sva_bench.study.options import Options
from sva_bench.study.publish import report_again
from sva_bench.study.run import measure, run
from tests.results_for_tests import figures, plan_result
from tests.worlds_for_tests import world_of

QUICK = Options(trials=200, rollouts=2, fidelity="kinematic")


def everybody_home(run: Executed, *, noisy: bool) -> Figure:
    """The share of trials in which every robot came home, all of it put down to the failures drawn."""
    home = (run.end == ENDS.index("home")).all(axis=1).astype(np.float64)
    return figure_of(home, (0.0, 1.0), np.zeros(len(home)), (0.0, 0.0), run.rollout, noisy=noisy)


HOME = Statistic(key="everybody_home", label="everybody home", unit="%", factor=100.0, measure=everybody_home,
                 meaning="share of trials in which every robot came home")


@pytest.fixture
def with_home(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(catalogue, "STATISTICS", (*STATISTICS, HOME))


@pytest.mark.usefixtures("with_home")
def test_a_new_entry_shows_in_summary_terminal_page_and_csv(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    done = run(world_of(tmp_path), QUICK, tmp_path / "runs", None, lambda *_: None)
    written = json.loads((done.folder / "summary.json").read_text())
    half = next(s for s in written["scenarios"] if s["name"] == "half")  # uv2 is there in half of the missions
    held = half["plans"]["stochastic"]["statistics"]["everybody_home"]
    assert 0.4 < held["mean"] < 0.6
    assert held["ci95"][0] < held["mean"] < held["ci95"][1]
    low, high = held["ci95"]
    shown = with_interval(Estimate(mean=100 * held["mean"], ci95=(100 * low, 100 * high)))
    print_summary(done.summary)
    printed = capsys.readouterr().out
    page = (done.folder / "report.html").read_text().replace("\u00a0", " ")
    for text in (printed, page):
        assert "everybody" in text
        assert shown.split()[0] in text
    assert f">{shown}<" in page
    write_csv(done.folder)
    with (done.folder / "statistics.csv").open() as file:
        rows = {(row["scenario"], row["planner"]): row for row in csv.DictReader(file)}
    row = rows["half", "stochastic"]
    assert [float(row[f"everybody_home{end}"]) for end in ("", "_low", "_high")] == pytest.approx(
        [100 * held["mean"], 100 * low, 100 * high])
    # What was measured is read again as it was written.
    before = (done.folder / "report.html").read_bytes()
    report_again(done.folder)
    assert (done.folder / "report.html").read_bytes() == before


@pytest.mark.usefixtures("with_home")
def test_a_new_entry_adds_up_over_ranges_of_trials(tmp_path: Path) -> None:
    done = measure(world_of(tmp_path), QUICK, None, lambda *_: None)
    s, d = (next(run for run in done.executed if run.case.role == role) for role in ("stochastic", "deterministic"))
    whole = tally_from(stored_tally(tally_of({"stochastic": s, "deterministic": d}, noisy=True)))
    twice = join(whole, whole)
    for plan, again in zip(whole.plans.values(), twice.plans.values(), strict=True):
        one, two = plan.statistics["everybody_home"], again.statistics["everybody_home"]
        assert (two.mean, two.drawn.count) == (one.mean, 2 * one.drawn.count)
    assert figure_from(stored_tally(whole).plans["stochastic"].statistics["everybody_home"]).mean == \
        done.summary.scenarios[0].plans["stochastic"].statistics["everybody_home"].mean


def test_without_measured_statistics_a_summary_has_no_such_key() -> None:
    assert "statistics" not in as_dict(figures(3.0))


def test_the_table_in_the_docs_is_that_of_the_catalogue() -> None:
    text = (Path(__file__).parents[2] / "docs" / "statistics.md").read_text(encoding="utf-8")
    begin, end = "<!-- statistics: begin -->\n", "<!-- statistics: end -->"
    held = text[text.index(begin) + len(begin):text.index(end)]
    assert held == as_markdown(), "put what `as_markdown()` gives between the two marks"


def test_every_entry_names_the_key_of_its_figure_in_the_summary() -> None:
    # A plan whose every figure is another one: what an entry reads must be what stands at its place.
    numbers = iter(range(1, 100))
    plan = plan_result(0.0)
    for record in (plan.distribution, plan.ledger):
        for item in fields(record):
            object.__setattr__(record, item.name, float(next(numbers)))
    for name in ("promised", "expected"):
        object.__setattr__(plan, name, float(next(numbers)))
    for name in ("executed", "executed_controlled"):
        object.__setattr__(plan, name, Estimate(mean=float(next(numbers)), ci95=None))
    # With measured entries among them: two, as their figures might be mixed up.
    entries = (*STATISTICS, HOME, replace(HOME, key="nobody_home", factor=1.0))
    object.__setattr__(plan, "statistics", {
        entry.key: Estimate(mean=float(next(numbers)), ci95=None) for entry in entries if entry.measure is not None})
    data = as_dict(plan)
    for entry in entries:
        held: Any = data
        for key in entry.place.split(".", 1 if entry.measure is not None else -1):
            held = held[key]
        value = entry.of(plan)
        mean = held["mean"] if isinstance(value, Estimate) else held
        assert (value.mean if isinstance(value, Estimate) else value) == entry.factor * mean, entry.key
        assert entry.interval == isinstance(value, Estimate), entry.key
    keys = [entry.key for entry in STATISTICS]
    assert len(set(keys)) == len(keys)
    assert {f"distribution.{item.name}" for item in fields(Distribution)} <= set(keys)
    assert {f"ledger.{item.name}" for item in fields(Ledger)} - set(keys) == {"ledger.promised", "ledger.executed"}


def test_an_entry_is_read_or_measured_and_never_both() -> None:
    with pytest.raises(ValueError, match="one of the two"):
        Statistic(key="x", label="x", meaning="x")
    with pytest.raises(ValueError, match="one of the two"):
        Statistic(key="x", label="x", meaning="x", measure=everybody_home, read=lambda plan: plan.expected)
