"""What a run folder claims, worked out again: it holds, and whatever is changed in it is found."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from sva_bench.errors import BadInput
from sva_bench.storage.tables import write_table
from sva_bench.study.verify import verify
from tests.commands_for_tests import sva_bench
from tests.worlds_for_tests import SMALL


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with a reaction, driven by the twin under noise."""
    folder = tmp_path_factory.mktemp("run")
    (folder / "small.yaml").write_text(SMALL, encoding="utf-8")
    done = sva_bench("run", "small.yaml", "--trials", 40, "--rollouts", 2, "--fidelity", "kinematic", "--policy",
                     "none,resolve", "--workers", 1, cwd=folder)
    assert done.returncode == 0, done.stderr
    (run,) = (folder / "runs").iterdir()
    return run


@pytest.mark.long
def test_a_run_with_other_failure_processes_holds(tmp_path: Path) -> None:
    # Its instances say mean times to failure, which the world's own process has no use for.
    (tmp_path / "small.yaml").write_text(SMALL, encoding="utf-8")
    done = sva_bench("run", "small.yaml", "--trials", 20, "--rollouts", 2, "--fidelity", "kinematic", "--assumptions",
                     "--workers", 1, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (run,) = (tmp_path / "runs").iterdir()
    assert "mtbf_s" in (run / "instance-half.json").read_text()
    assert verify(run, 1, None, lambda *_: None).difference is None


def in_summary(change: Callable[[dict[str, Any]], None]) -> Callable[[Path], None]:
    """A change of the first scenario of ``summary.json``."""
    def changed(run: Path) -> None:
        summary = json.loads((run / "summary.json").read_text())
        change(summary["scenarios"][0])
        (run / "summary.json").write_text(json.dumps(summary))
    return changed


def in_table(name: str, column: str, change: Callable[[list[Any]], None]) -> Callable[[Path], None]:
    """A change of a column of a table."""
    def changed(run: Path) -> None:
        table = pq.read_table(run / name)
        values = table.column(column).to_pylist()
        change(values)
        where = table.schema.get_field_index(column)
        write_table(run / name, table.schema, [table.set_column(where, table.schema.field(where), pa.array(
            values, table.schema.field(where).type))])
    return changed


def add(to: dict[str, Any], key: str, amount: float) -> None:
    to[key] += amount


def in_instance(run: Path) -> None:
    path = run / "instance-half.json"
    path.write_text(path.read_text().replace('"availability": 0.5', '"availability": 0.6'))


def no_text(run: Path) -> None:
    (run / "instance-half.json").write_bytes(b"\xff" * 100)


def promised_more(run: Path) -> None:
    """The stochastic plan's promise, in its file and the summary alike."""
    in_summary(lambda scenario: add(scenario["plans"]["stochastic"], "promised", 1.0))(run)


CHANGES = {
    "by_robot": in_summary(lambda s: add(s["plans"]["stochastic"]["by_robot"], "uv1", 1.0)),
    "expected": in_summary(lambda s: add(s["plans"]["deterministic"], "expected", 0.5)),
    "promised": promised_more,
    "vss.executed": in_summary(lambda s: add(s["vss"]["executed"], "mean", 1.0)),
    "ends": in_summary(lambda s: add(s["plans"]["stochastic"]["ends"], "home", 1)),
    "resolve": in_summary(lambda s: add(s["reactions"][0]["plans"]["stochastic"]["by_robot"], "uv1", 1.0)),
    "instance-half.json": in_instance,
    "an instance that is no text": no_text,
    "travel_times.parquet": in_table("travel_times.parquet", "raw_s", lambda v: v.__setitem__(3, v[3] + 0.001)),
    "end_time_s": in_table("outcomes.parquet", "end_time_s", lambda v: v.__setitem__(0, v[0] + 1e-9)),
    "executed.mean": in_table("outcomes.parquet", "value", lambda v: v.__setitem__(0, v[0] + 5.0)),
}


def test_a_run_holds_what_it_claims(finished: Path) -> None:
    before = {path: path.read_bytes() for path in finished.rglob("*") if path.is_file()}
    found = verify(finished, 2, None, lambda *_: None)
    assert found.difference is None
    assert found.checked[-1].endswith("played again, the same row by row")
    assert {path: path.read_bytes() for path in finished.rglob("*") if path.is_file()} == before


@pytest.mark.parametrize("where", CHANGES)
def test_whatever_is_changed_in_a_run_is_found(finished: Path, tmp_path: Path, where: str) -> None:
    run = tmp_path / finished.name
    shutil.copytree(finished, run)
    CHANGES[where](run)
    assert verify(run, 2, None, lambda *_: None).difference is not None


def test_the_command_exits_with_5_and_names_the_difference(finished: Path, tmp_path: Path) -> None:
    run = tmp_path / finished.name
    shutil.copytree(finished, run)
    CHANGES["end_time_s"](run)
    for folder, code in ((finished, 0), (run, 5)):
        done = sva_bench("verify", folder, "--json", "--workers", 1, cwd=tmp_path)
        assert done.returncode == code, done.stderr
        assert json.loads(done.stdout)["holds"] == (code == 0)
    assert "trial 0, uv1: end_time_s is" in json.loads(done.stdout)["difference"]


def test_what_is_no_run_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no run folder"):
        verify(tmp_path, 2, None, lambda *_: None)
