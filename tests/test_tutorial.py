"""What the tutorials tell of their worlds; of docs/tutorial.md on fewer draws."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

import sva_bench as sb

ROOT = Path(__file__).parents[1]
WORLD = ROOT / "worlds" / "three-halls.yaml"


def test_the_page_says_in_processor_time_what_it_takes() -> None:
    # By the clock it would depend on the number of cores, and on what else they do.
    page = " ".join((ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8").split())
    assert re.findall(r"takes [\w.]+ (?:s|seconds?|minutes?)\b( of processor time)?", page) == [" of processor time"]


@pytest.mark.long
@pytest.mark.parametrize("scenario", ["S1", "S2"])
def test_the_nominal_plan_fails_in_a_fifth_of_missions_and_the_calibrated_one_in_less_than_a_hundredth(
        scenario: str) -> None:
    result = sb.run(WORLD, trials=64, rollouts=64, scenario=scenario, calibrate=1)
    (found,) = result.summary.scenarios
    assert found.calibration is not None
    assert found.calibration.reached
    assert found.calibration.bad.share < 0.01
    assert found.calibration.nominal.bad.share > 0.2
    assert found.plans["calibrated"].executed.mean > 0.95 * found.plans["stochastic"].executed.mean


@pytest.mark.long
def test_the_figures_of_the_two_rooms_are_those_of_the_page(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "two-rooms.md").read_text(encoding="utf-8")
    result = sb.run(ROOT / "examples" / "two-rooms.yaml", out=tmp_path)
    (found,) = result.summary.scenarios
    assert found.vss is not None
    for name, plan in found.plans.items():
        assert f"| {name} | {plan.promised:.1f} | {plan.expected:.1f} | {shown(plan.executed)} |" in page
    assert f"| {shown(found.vss.executed)} |" in page
    assert f"That is {found.evpi:.0f} more" in " ".join(page.split())


def shown(figure: Any) -> str:
    """A figure as tables show it."""
    return f"{figure.mean:.1f} [{figure.ci95[0]:.1f}, {figure.ci95[1]:.1f}]"
