"""What is seen of a solve while it goes on."""

from __future__ import annotations

import os
import pty
import re
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest

from sva_bench.cli.solving import said, watched_solve
from sva_bench.generate.instances import random_instance
from sva_bench.solver.risk import RiskMeasure
from sva_bench.solver.two_stage import SolveLimits, Watched, plan_averse, plan_deterministic, plan_stochastic


@dataclass(frozen=True)
class Found:
    objective: str = "stochastic"
    value: float = 50.0
    bound: float = 55.0
    nodes: int = 1


@pytest.mark.parametrize(("found", "line"), [
    (Found(), "stochastic: value 50, bound 55, gap 10 %, 1 node"),
    (Found(nodes=7, bound=50.0), "stochastic: value 50, bound 50, gap 0 %, 7 nodes"),
    (Found(value=0.0, nodes=0), "stochastic: value 0, 0 nodes")])
def test_a_line_says_value_bound_gap_and_nodes(found: Found, line: str) -> None:
    assert said(found) == line


def test_without_a_terminal_a_line_comes_at_times_and_none_after_the_end(capfd: pytest.CaptureFixture[str]) -> None:
    with watched_solve(every_s=0.05) as watch:
        watch(Found())
        time.sleep(0.3)
    lines = capfd.readouterr().err.splitlines()
    assert lines[0] == "solving ..."
    assert lines.count("stochastic: value 50, bound 55, gap 10 %, 1 node") >= 2
    time.sleep(0.15)
    assert capfd.readouterr().err == ""


def test_what_is_watched_is_in_the_units_of_the_instance_and_ends_as_the_plan_says() -> None:
    instance = random_instance("B", pois=9, vehicles=2, availability=0.6, seed=4)
    seen: list[Watched] = []
    limits = SolveLimits(watch=seen.append)
    plan = plan_stochastic(instance, limits)
    assert plan.value == pytest.approx(seen[0].value, rel=1e-9)
    assert plan.bound == pytest.approx(seen[0].bound, rel=1e-6)
    plan_deterministic(instance, plan, limits)
    assert [each.objective for each in seen] == ["stochastic", "deterministic"]
    averse = plan_averse(instance, RiskMeasure(kind="cvar", weight=0.5, beta=0.8), limits)
    assert averse.value == pytest.approx(seen[-1].value, rel=1e-9)
    assert seen[-1].objective == "cvar"


def test_on_a_terminal_a_line_changes(tmp_path: Path) -> None:
    instance = tmp_path / "i.json"
    subprocess.run([sys.executable, "-m", "sva_bench", "instance", "random", "--family", "B", "--pois", "30", "-o",
                    str(instance)], check=True, capture_output=True)
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "sva_bench", "plan", str(instance), "-o", str(tmp_path / "p.json"), "--time-limit", "2"],
        stderr=theirs, env=os.environ | {"TERM": "xterm-256color", "COLUMNS": "100"})
    os.close(theirs)
    shown = b""
    try:
        while more := os.read(ours, 4096):
            shown += more
    except OSError:  # closed at the other end
        pass
    assert process.wait(timeout=60) == 0
    plain = re.sub(rb"\x1b\[[0-9;?]*[a-zA-Z]", b"", shown).decode()
    assert re.search(r"stochastic: value \d+(\.\d+)?, bound \d+(\.\d+)?, gap .* %, \d+ node", plain), plain
