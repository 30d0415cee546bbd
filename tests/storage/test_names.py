"""Names joined into keys and file names: no two things share one, whatever they are called."""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from sva_bench.__main__ import run_command_line
from sva_bench.batch.grid import Point
from sva_bench.errors import BadInput
from sva_bench.storage.run_folder import stem_of
from sva_bench.storage.stored_run import read_content
from sva_bench.study.inputs import by_name
from tests.cli.test_commands import TINY
from tests.worlds_for_tests import SMALL, world_of

# In the first scenario nobody fails, in the second everybody does.
SCENARIOS = "scenarios:\n  S: {uv1: 1.0, uv2: 1.0}\n  S-a: {uv1: 0.0, uv2: 0.0}\n"
PLANS = {"a-b": {"uv1": ["base", "p1", "base"]}, "b": {"uv2": ["base", "p1", "base"]}, "x+y é": {"uv1": ["base"]}}


@pytest.fixture
def executed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The run folder of plans and scenarios whose names meet when they are joined by a dash."""
    monkeypatch.chdir(tmp_path)
    begin, end = SMALL.index("scenarios:"), SMALL.index("noise:")
    (tmp_path / "small.yaml").write_text(SMALL[:begin] + SCENARIOS + SMALL[end:], encoding="utf-8")
    for name, routes in PLANS.items():
        (tmp_path / f"{name}.json").write_text(json.dumps({"format": "sva-bench/plan@1", "routes": routes}))
    assert run_command_line(["execute", "small.yaml", *(f"{name}.json" for name in PLANS), "--trials", "6",
                             "--fidelity", "kinematic", "--workers", "1"]) == 0
    (folder,) = (tmp_path / "runs").iterdir()
    return folder


def test_plans_and_scenarios_of_names_that_meet_keep_their_own_trials_and_files(executed: Path) -> None:
    summary = json.loads((executed / "summary.json").read_text())
    # By hand: p1 is worth 10 to uv1 and 40 to uv2.
    worth = {"S": {"a-b": 10.0, "b": 40.0, "x+y é": 0.0}, "S-a": dict.fromkeys(PLANS, 0.0)}
    assert {s["name"]: {name: plan["executed"]["mean"] for name, plan in s["plans"].items()}
            for s in summary["scenarios"]} == worth
    rows = pq.read_table(executed / "outcomes.parquet").to_pylist()
    assert {(row["scenario"], row["planner"]) for row in rows} == set(product(worth, PLANS))
    stems = {f"{scenario}+{name}" for scenario, name in product(worth, PLANS)}
    # In S-a everybody fails and no plan collects anything, but they differ all the same.
    for folder, ending, pairs in (("plans", ".json", set()), ("recordings", ".rrd", {"S@compare", "S-a@compare"})):
        assert {path.name for path in (executed / folder).iterdir()} == {stem + ending for stem in stems | pairs}
    for scenario, (name, routes) in product(worth, PLANS.items()):
        held = json.loads((executed / "plans" / f"{scenario}+{name}.json").read_text())["routes"]
        assert held == {robot: [] if route == ["base"] else route for robot, route in routes.items()}


def test_the_report_of_such_a_run_finds_each_plans_routes_and_links_its_recordings(executed: Path) -> None:
    page = (executed / "report.html").read_bytes()
    content = read_content(executed)
    for key, plan in ((("S", "a-b"), "a-b"), (("S-a", "b"), "b")):
        assert {robot: list(route) for robot, route in content.routes[key].items()} == PLANS[plan]
    assert run_command_line(["report", str(executed)]) == 0
    assert (executed / "report.html").read_bytes() == page
    assert b'href="recordings/S%2Bx%2By%20%C3%A9.rrd"' in page


def test_no_two_plans_of_a_run_share_a_file_name() -> None:
    ours = ["stochastic", "deterministic", "informed", "anticipative-report", "calibrated"]
    scenarios = ["S", "S-stochastic", "S-anticipative", "S-anticipative-report", "S-a", "S-deterministic-stochastic"]
    assert len({stem_of(s, p, foreign=False) for s, p in product(scenarios, ours)}) == len(scenarios) * len(ours)
    foreign = [*ours, "a", "a-b", "b", "+", "a+b", "stochastic-a+S"]
    stems = {stem_of(s, p, foreign=True) for s, p in product(scenarios, foreign)}
    assert len(stems) == len(scenarios) * len(foreign)
    assert not stems & {stem_of(s, p, foreign=False) for s, p in product(scenarios, ours)}


@pytest.mark.parametrize(("paths", "said"), [
    (["a.json", "other/a.json"], "there is another plan named 'a', a.json"),
    (["a.json", "a.json"], "a.json: this plan is given twice; name it once"),
    (["Plan.json", "plan.json"], "in more than capitals"),
    (["\u00e9.json", "e\u0301.json"], "there is another plan"),  # one letter, written in two ways
    (["stra\u00dfe.json", "STRASSE.json"], "there is another plan"),
    (["a\nb.json"], "can't be shown"), (["a\x1b[2J.json"], "can't be shown"), (["\udcff.json"], "can't be shown"),
    (["n" * 121 + ".json"], "longer than 120 bytes"),
])
def test_plans_with_equal_or_unprintable_names_are_refused(paths: list[str], said: str) -> None:
    with pytest.raises(BadInput) as caught:
        by_name([Path(path) for path in paths])
    assert said in str(caught.value)
    assert str(caught.value).isprintable()


def test_plans_may_be_called_anything_else() -> None:
    paths = ["a b.json", "a+b.json", "S+compare.json", ".json", "\u8a08\u753b.json", "a.b.json", "it's \"q\" [x].json"]
    assert list(by_name([Path(path) for path in paths])) == [Path(path).stem for path in paths]


def test_variants_of_a_world_have_names_that_differ(tmp_path: Path) -> None:
    world = world_of(tmp_path)
    # 20 000 variants and 24 bits would share names eleven times.
    names = {Point(world=world, planner="prmstar", variant=f"margin={k}").name for k in range(20_000)}
    assert len(names) == 20_000


@pytest.mark.parametrize(("second", "said"), [
    ("b.yaml", "b.yaml: its world is named 'small', as that of a.yaml"),
    ("a.yaml", "a.yaml: this world is given twice")])
def test_the_error_of_worlds_with_equal_names_lists_their_files(
    second: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("a", "b"):
        (tmp_path / f"{name}.yaml").write_text(SMALL, encoding="utf-8")
    assert run_command_line(["batch", "a.yaml", second, "--dry-run"]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize("route", [[], ["base"], ["base", "base"]])
def test_a_robot_without_a_stop_stays_home(
    route: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "i.json").write_text(TINY)
    (tmp_path / "p.json").write_text(json.dumps({"format": "sva-bench/plan@1", "routes": {"uv1": route}}))
    assert run_command_line(["certify", "i.json", "p.json", "--json"]) == 0
    certificate = json.loads(capsys.readouterr().out)
    assert (certificate["feasible"], certificate["expected"]) == (True, 0.0)
