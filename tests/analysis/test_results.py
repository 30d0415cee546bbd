"""Results at the file's door: what is written is read again as it was, and nothing else is."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sva_bench.analysis.over_maps import UnitSummary
from sva_bench.analysis.results import SUMMARY, Estimate
from sva_bench.analysis.summaries import ComparisonSummary, Reach, Summary, summary_form
from sva_bench.errors import BadFile
from sva_bench.files.documents import read_json, validate
from sva_bench.files.records import Record, as_dict, from_dict
from sva_bench.study.compare import execute_plans
from sva_bench.study.costs import plan_costs
from sva_bench.study.options import Options
from sva_bench.study.planning import plan_scenarios
from sva_bench.study.run import measure
from tests.results_for_tests import summary, unit
from tests.worlds_for_tests import world_of

QUICK = Options(trials=20, rollouts=2, fidelity="kinematic")


def again(record: Record) -> Any:
    """The record, written and read."""
    return from_dict(type(record), json.loads(json.dumps(as_dict(record))))


def test_what_is_written_is_read_again_as_it_was(tmp_path: Path) -> None:
    world = world_of(tmp_path)
    found = measure(world, replace(QUICK, informed=True, assumptions=True), None, lambda *_: None).summary
    assert again(found) == found
    costs = plan_costs(world, "prmstar", lambda *_: None)
    plans = {name: planned.stochastic for name, planned in plan_scenarios(world, costs, QUICK, lambda *_: None).items()}
    compared = execute_plans(world, plans, QUICK, tmp_path / "runs", None, lambda *_: None, costs).summary
    assert isinstance(compared, ComparisonSummary)
    assert again(compared) == compared
    assert again(unit("a", 3.0, 2.0)) == unit("a", 3.0, 2.0)
    for record, form in ((found, Summary), (compared, ComparisonSummary)):
        assert summary_form(as_dict(record)) is form


def test_results_not_requested_are_absent_and_undefined_ones_are_null() -> None:
    data = as_dict(summary((1.0, 3.0), 20.0))
    (scenario,) = data["scenarios"]
    assert not {"evpi_executed", "assumptions"} & set(scenario)
    assert "precision" not in data
    assert scenario["evpi"] is None
    assert scenario["vss"]["executed_range"] is None
    plan = scenario["plans"]["stochastic"]
    # A key of the run's own stands where it belongs, not after all that a batch has too.
    assert list(plan)[4:9] == ["executed", "executed_controlled", "distribution", "end_shares", "by_robot"]
    (of_a_batch,) = as_dict(unit("a", 3.0))["scenarios"]
    assert list(of_a_batch["plans"]["stochastic"])[4:] == ["executed", "by_robot", "ends", "ledger"]


def test_lists_and_minus_zeros_are_plain() -> None:
    assert as_dict(Estimate(mean=-0.0, ci95=(-0.0, 1.0))) == {"mean": 0.0, "ci95": [0.0, 1.0]}
    assert "-0.0" not in json.dumps(as_dict(Estimate(mean=-0.0, ci95=(-0.0, 1.0))))
    reach = Reach(nothing=False, robots=("a",), pois=(), missed={"a": ("p",)})
    assert as_dict(reach) == {"nothing": False, "robots": ["a"], "pois": [], "missed": {"a": ["p"]}}


@pytest.mark.parametrize(("at", "value", "said"), [
    ("scenarios.0.plans.stochastic.executed.mean", "1", "expected a number, found the text '1': take the quotes away"),
    ("scenarios.0.plans.stochastic.executed.ci95", [1.0], r"expected \[low, high\]"),
    ("scenarios.0.plans.stochastic.executed.ci95", [3.0, 1.0], r"expected \[low, high\], found \[3.0, 1.0\]"),
    ("scenarios.0.plans.stochastic.execute", 1, "unknown key 'execute'; did you mean 'executed'"),
    ("scenarios.0.plans.stochastic", 3, "expected a mapping"),
    ("scenarios.0.evpi_executed", None, "expected something, found nothing"),
    ("scenarios", [], "expected at least 1 entry, found 0"),
    ("trials", 0, "expected at least 1"),
    ("reach", None, "expected a mapping"),
])
def test_an_invalid_summary_is_an_error_with_file_line_and_key(at: str, value: Any, said: str, tmp_path: Path) -> None:
    data: Any = as_dict(summary((1.0, 3.0), 20.0))
    held, *keys = data, *at.split(".")
    for key in keys[:-1]:
        held = held[int(key) if key.isdigit() else key]
    held[keys[-1]] = value
    path = tmp_path / "summary.json"
    path.write_text(json.dumps(data, indent=1))
    document = read_json(path, 10**6)
    with pytest.raises(BadFile, match=said) as told:
        validate(document, summary_form(document.data), SUMMARY)
    assert str(told.value).startswith(f"{path}:")


def test_a_summary_of_nothing_is_of_a_run() -> None:
    some: tuple[Any, ...] = (None, [], {}, {"scenarios": 3}, {"scenarios": []}, {"scenarios": [3]})
    for data in some:
        assert summary_form(data) is Summary


def test_units_are_labelled_by_their_map() -> None:
    assert unit("a", 1.0).label == "a"
    swept: UnitSummary = replace(unit("a", 1.0), variant="x=1")
    assert swept.label == "a (x=1)"
