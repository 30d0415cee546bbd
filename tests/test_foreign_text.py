"""Foreign text: no terminal obeys it, no encoding stumbles over it."""

from __future__ import annotations

import html
import json
import logging
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sva_bench.__main__ import run_command_line
from sva_bench.cli.terminal import results, set_up_logging
from sva_bench.errors import BadFile
from sva_bench.files.printable import is_text, printable
from sva_bench.mission.instance_file import read_instance
from sva_bench.mission.plan_file import read_plan
from sva_bench.report.page import text as text_of_a_page
from sva_bench.report.results_charts import over_maps
from tests.test_bounds import TINY
from tests.worlds_for_tests import SMALL

EVIL = "\x1b]0;owned\x07\x1b[31mred\x9b2J\u202eback\udcff\r\n"


def test_what_a_terminal_obeys_is_spelt_out_and_all_else_is_left() -> None:
    assert printable("\x1b[31m\x07\x9b\x7f") == r"\x1b[31m\x07\x9b\x7f"
    assert printable("\u202e\ud800\udcff") == r"\u202e\ud800\xff"
    assert printable("Halle 7 – Über\n\tπ [1, 2] 漢字") == "Halle 7 – Über\n\tπ [1, 2] 漢字"


@given(st.text())
def test_printable_text_can_be_written_and_stays_as_it_is(text: str) -> None:
    shown = printable(text)
    shown.encode()
    assert printable(shown) == shown
    assert is_text(shown)
    assert not any(ord(letter) < 32 and letter not in "\n\t" for letter in shown)


def test_tables_messages_and_warnings_are_all_made_printable(
    capsys: pytest.CaptureFixture[str]
) -> None:
    from rich.table import Table
    from rich.text import Text

    table = Table(EVIL)
    table.add_row(f"[/x]{EVIL}", style="red")
    results().print(table, Text(EVIL), EVIL)
    set_up_logging(verbose=False)
    logging.getLogger("sva_bench").warning("%s", EVIL)
    printed = capsys.readouterr()
    for said in printed:
        assert not {"\x1b", "\x07", "\x9b", "\u202e", "\udcff"} & set(said)
    assert r"\x1b[31mred" in printed.out
    assert r"\x1b[31mred" in printed.err
    assert "[/x]" in printed.out  # no markup of ours


def test_a_page_shows_no_control_character() -> None:
    assert text_of_a_page("<\x1b\udcff") == r"&lt;\x1b\xff"


@pytest.mark.parametrize("arguments", [
    [EVIL], ["plan", EVIL], ["run", f"{EVIL}.yaml"], ["run", "x.yaml", "--fidelity", EVIL], ["run", f"--{EVIL}"],
    ["batch", f"{EVIL}.yaml"], ["batch", "x*", EVIL], ["batch", "status", EVIL], ["report", EVIL], ["view", EVIL],
    ["execute", EVIL, EVIL], ["world", "check", EVIL], ["certify", EVIL, EVIL], ["run", "x.yaml", "--scenario", EVIL],
    ["batch", "x.yaml", "--set", EVIL], ["batch", "x.yaml", "--seed", EVIL], ["run", "x.yaml", "--precision", EVIL]])
def test_arguments_that_are_no_utf8_or_hold_escapes_are_quoted_safely(
    arguments: list[str], capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_command_line(arguments) == 2
    printed = "".join(capsys.readouterr())
    assert not {"\x1b", "\x07", "\x9b", "\u202e", "\udcff"} & set(printed)


def test_names_in_foreign_files_are_quoted_safely(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "i.json").write_text(json.dumps(TINY))
    contents: list[dict[str, Any]] = [
        {"routes": {"\x1b[31m": []}}, {"routes": {"uv1": ["\x1b[31m"]}}, {"routes": {}, "\x1b[31m": 1},
        {"routes": {}, "details": {"\ud800": 1}}, {"routes": {}, "instance": "\ud800"}]
    for content in contents:
        (tmp_path / "p.json").write_text(json.dumps({"format": "sva-bench/plan@1", **content}))
        assert run_command_line(["certify", str(tmp_path / "i.json"), str(tmp_path / "p.json")]) == 2
        printed = "".join(capsys.readouterr())
        assert "\x1b" not in printed
        assert printed.count("error:") == 1


def test_details_of_a_plan_are_free_but_must_be_text(tmp_path: Path) -> None:
    (tmp_path / "i.json").write_text(json.dumps(TINY))
    details = {"é\x1b": [1]}
    (tmp_path / "p.json").write_text(json.dumps({"format": "sva-bench/plan@1", "routes": {}, "details": details}))
    assert read_plan(tmp_path / "p.json", read_instance(tmp_path / "i.json")).details == details
    (tmp_path / "i.json").write_text(json.dumps(TINY | {"name": "\ud800"}))
    with pytest.raises(BadFile, match="name: input should be a valid string"):
        read_instance(tmp_path / "i.json")


@pytest.mark.long
def test_a_run_in_folders_whose_names_are_no_utf8_is_made_and_reported(tmp_path: Path) -> None:
    folder = tmp_path / os.fsdecode(b"caf\xe9\x1b[31m")
    try:
        folder.mkdir()
    except OSError:
        pytest.skip("this file system takes only names in UTF-8")
    (folder / "small.yaml").write_text(SMALL, encoding="utf-8")

    def told(*arguments: object) -> bytes:
        done = subprocess.run([sys.executable, "-m", "sva_bench", *map(str, arguments)], capture_output=True,
                              cwd=folder, timeout=300, check=False)
        assert done.returncode == 0, done.stderr
        assert b"\x1b" not in done.stdout + done.stderr
        (done.stdout + done.stderr).decode("utf-8")
        return done.stdout

    quick = ("--trials", 4, "--rollouts", 2, "--fidelity", "kinematic", "--workers", 1)
    json.loads(told("run", folder / "small.yaml", *quick, "--out", folder / "runs", "--json"))
    (run,) = (folder / "runs").iterdir()
    told("report", run)
    assert rb"caf\xe9\x1b[31m" in (run / "report.html").read_bytes()
    plan = next((run / "plans").iterdir())
    for name in (b"\xff.json", b"\x1b[31m.json", b"a\nb.json"):
        shutil.copy(plan, folder / os.fsdecode(name))
        assert run_command_line(["execute", str(folder / "small.yaml"), str(folder / os.fsdecode(name)),
                                 *map(str, quick)]) == 2
    told("execute", folder / "small.yaml", shutil.copy(plan, folder / r"[red] $\frac é.json"), *quick, "--out", folder)


@pytest.mark.parametrize("name", ["$\\frac$", "a$b$", "$x_{$", "[red]", "漢字"])
def test_a_chart_takes_names_as_they_are(name: str) -> None:
    assert html.escape(name) in over_maps({name: {name: [1.0, 2.0]}}, "unit")
