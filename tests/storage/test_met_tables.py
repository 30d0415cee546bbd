"""Contacts and waits of a run: in its tables, in its page, and in folders that lack them or hold what is wrong."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest

from sva_bench.errors import BadFile
from sva_bench.storage.stored_run import read_content, write_csv
from sva_bench.storage.tables import CONTACTS, LEGS, WAITS
from sva_bench.study.options import Options
from sva_bench.study.publish import Run, report_again
from sva_bench.study.run import run
from sva_bench.world.load import load_world
from tests.worlds_for_tests import world_of

DOOR = Path(__file__).parents[2] / "examples" / "one-door.yaml"
NAMES = [name for name in LEGS.names if name in CONTACTS.names]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A run in which robots touch posts and wait at a door."""
    return run(load_world(DOOR), Options(trials=16, rollouts=8), tmp_path_factory.mktemp("met"), None, lambda *_: None)


@pytest.fixture
def folder(finished: Run, tmp_path: Path) -> Path:
    return Path(shutil.copytree(finished.folder, tmp_path / "run"))


def table(folder: Path, name: str) -> pa.Table:
    return pq.read_table(folder / f"{name}.parquet")


def test_contacts_and_waits_are_those_of_the_legs(finished: Run) -> None:
    legs, waits = table(finished.folder, "legs"), table(finished.folder, "waits")
    assert table(finished.folder, "contacts").schema.equals(CONTACTS)
    assert waits.schema.equals(WAITS)
    waited: dict[tuple[Any, ...], float] = {}
    for row in waits.to_pylist():
        key = tuple(row[name] for name in NAMES)
        waited[key] = waited.get(key, 0.0) + row["lasts_s"]
    told = {tuple(row[name] for name in NAMES): row["waited_s"] for row in legs.to_pylist() if row["waited_s"]}
    assert waited == told
    assert waited
    for name in ("contacts", "waits"):
        driven = {tuple(row[n] for n in NAMES): row["driven_s"] for row in legs.to_pylist()}
        assert all(0 <= row["since_s"] <= driven[tuple(row[n] for n in NAMES)] + 1e-6
                   for row in table(finished.folder, name).to_pylist())


def test_contacts_of_a_mission_are_those_of_its_legs(finished: Run) -> None:
    # Of missions that end at home all legs were driven to their ends.
    outcomes, contacts = table(finished.folder, "outcomes").to_pylist(), table(finished.folder, "contacts").to_pylist()
    whole = [row for row in outcomes if row["end"] in ("home", "late") and row["stops_reached"]]
    assert whole
    for row in whole:
        mine = [c for c in contacts if all(c[n] == row[n] for n in ("scenario", "planner", "rollout", "robot"))]
        assert row["contacts"] == len(mine)


def test_a_run_without_noise_has_neither_table(tmp_path: Path) -> None:
    done = run(world_of(tmp_path), Options(trials=2, rollouts=2, fidelity="kinematic"), tmp_path / "runs", None,
               lambda *_: None)
    assert not list(done.folder.glob("contacts*")) + list(done.folder.glob("waits*"))
    assert read_content(done.folder).contacts.num_rows == 0
    assert "What robots met" not in (done.folder / "report.html").read_text()


def test_a_folder_of_an_older_version_is_read_without_them(folder: Path) -> None:
    for name in ("contacts", "waits"):
        (folder / f"{name}.parquet").unlink()
    summary = json.loads((folder / "summary.json").read_text())
    del summary["drives"]
    for plan in summary["scenarios"][0]["plans"].values():
        del plan["bad"]
    (folder / "summary.json").write_text(json.dumps(summary))
    assert report_again(folder).is_file()
    text = (folder / "report.html").read_text()
    assert "What robots met" not in text
    assert "in physics" not in text


def of_another_leg(rows: pa.Table) -> pa.Table:
    return rows.set_column(rows.schema.get_field_index("leg"), rows.schema.field("leg"), pc.add(rows["leg"], 40))


def word(column: str, value: str) -> Callable[[pa.Table], pa.Table]:
    def changed(rows: pa.Table) -> pa.Table:
        return rows.set_column(rows.schema.get_field_index(column), rows.schema.field(column),
                               pa.array([value] * rows.num_rows))

    return changed


def figure(column: str, value: float) -> Callable[[pa.Table], pa.Table]:
    def changed(rows: pa.Table) -> pa.Table:
        return rows.set_column(rows.schema.get_field_index(column), rows.schema.field(column),
                               pa.array([value] * rows.num_rows))

    return changed


@pytest.mark.parametrize(("name", "change", "said"), [
    ("contacts", word("solid", "box 9"), "'box 9' is unknown"), ("waits", word("cause", "d9"), "'d9' is unknown"),
    ("contacts", of_another_leg, "not of the legs that were driven"),
    ("waits", figure("lasts_s", -1.0), "between 0 and"), ("contacts", figure("x_m", 1e30), "between -1e+06 and"),
    ("contacts", lambda rows: rows.drop_columns(["stuck"]), "this column is missing")])
def test_a_table_that_is_not_of_the_run_is_refused(
    name: str, change: Callable[[pa.Table], pa.Table], said: str, folder: Path
) -> None:
    pq.write_table(change(table(folder, name)), folder / f"{name}.parquet")
    with pytest.raises(BadFile) as caught:
        read_content(folder)
    assert said in str(caught.value)
    assert f"{name}.parquet" in str(caught.value)


def test_they_are_written_for_spreadsheets_too(folder: Path) -> None:
    assert {"contacts.csv", "waits.csv"} <= {path.name for path in write_csv(folder)}
    head = (folder / "waits.csv").read_text().splitlines()[0].replace('"', "").split(",")
    assert head == WAITS.names


def test_the_page_shows_where_and_how_often(finished: Run) -> None:
    text = (finished.folder / "report.html").read_text()
    contacts = table(finished.folder, "contacts")
    mine = contacts.filter(pc.equal(contacts["planner"], "stochastic")).num_rows
    # Both plans have the same routes here, so they share a map.
    assert text.count("<figure class=map>") == 1
    assert "<b>stochastic and deterministic</b>" in text
    assert re.search(rf"{mine} contacts? with (an )?obstacles? and \d+ waits? under 8 noise draws", text)
    marked = re.findall(r'<g class="met contact">.*?>(\d+)</text></g>', text)
    assert sum(map(int, marked)) == mine
    assert "What robots waited for" in text


def test_the_summary_says_how_drives_were_made(finished: Run) -> None:
    told = json.loads((finished.folder / "summary.json").read_text())["drives"]
    assert told["unit"] == "hops"
    assert 0 < told["in_physics_pct"] <= 100
    assert told["checked"] <= told["count"]
    assert (told["worst_check_pct"] is None) == (told["checked"] == 0)
    assert "of the driving time of" in (finished.folder / "report.html").read_text()
