"""The door to HiGHS: what every solver is opened with."""

from __future__ import annotations

import math
import subprocess
import sys

import highspy
import numpy as np
import pytest

from sva_bench.solver import highs
from sva_bench.solver.highs import Relaxation, maximise
from sva_bench.solver.program import LinearModel, Rows

KNAPSACK = LinearModel(
    objective=np.array([3.0, 5.0]), upper=np.array([2.0, 2.0]), integer=np.array([True, True]),
    rows=Rows(lower=np.array([-math.inf]), upper=np.array([5.0]), start=np.array([0, 2]), column=np.array([0, 1]),
              value=np.array([2.0, 3.0])))


def test_every_program_is_solved_on_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    # With several, the order of the search is the machine's, and with it which of the tied plans is found.
    opened: list[highspy.Highs] = []

    class Watched(highs._Silent):
        def __init__(self) -> None:
            super().__init__()
            opened.append(self)

    monkeypatch.setattr(highs, "_Silent", Watched)
    found = maximise(KNAPSACK, Rows.none(), gap=0.0, absolute_gap=0.0, time_limit_s=math.inf)
    assert found.objective == 8  # one of each: 2 + 3 <= 5
    assert Relaxation(KNAPSACK).solve(math.inf).objective == pytest.approx(25 / 3)  # 5/3 of the second
    assert len(opened) == 2
    for solver in opened:
        assert solver.getOptionValue("threads")[1] == 1
        assert solver.getOptionValue("parallel")[1] == "off"


def test_not_even_the_first_solver_of_a_process_prints_a_banner() -> None:
    script = "from sva_bench.solver.highs import _Silent; _Silent()"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120, check=True)
    assert (done.stdout, done.stderr) == ("", "")
