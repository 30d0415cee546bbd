"""What page and terminal say of calibrated plans, above all of those that are not."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from sva_bench.analysis.summaries import Summary
from sva_bench.cli.tables import print_summary
from sva_bench.study.options import Options
from sva_bench.study.run import run
from sva_bench.world.noise import Noise, People
from tests.worlds_for_tests import SMALL, world_of

MARKED = "calibrated (share not reached)"
NAMED_PLAINLY = re.compile(r"(?<!not )(?<!half-)(?<!safe-)\bcalibrated\b(?! \(share not reached)")
"""Not of plans: that one is not calibrated, and the files of recordings."""


@pytest.fixture(scope="module")
def missed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Summary]:
    """A run in which no costs reach the share: half of all metres have somebody in the way for long."""
    place = tmp_path_factory.mktemp("missed")
    world = replace(world_of(place, SMALL), noise=Noise(people=People(per_m=0.5, stop_s=200.0)))
    done = run(world, Options(trials=16, rollouts=4, fidelity="kinematic", calibrate=0.02), place, None,
               lambda *_: None)
    return done.folder, done.summary


def test_a_plan_that_missed_its_share_is_marked_wherever_it_is_named(
    missed: tuple[Path, Summary], capsys: pytest.CaptureFixture[str]
) -> None:
    folder, found = missed
    page = (folder / "report.html").read_text(encoding="utf-8").replace("\u00a0", " ")
    assert page.count(MARKED) > 20  # legends, answer, and a row or more in each table of plans
    assert NAMED_PLAINLY.findall(page) == []
    print_summary(found, wide=True)
    assert MARKED in (said := capsys.readouterr().out)
    # A narrow table breaks the name before its mark, so what counts here are the sentences.
    assert NAMED_PLAINLY.findall(" ".join(line.strip() for line in said.splitlines() if "│" not in line)) == []
