"""The examples of docs/extending.md, run as they stand there."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sva_bench.analysis import catalogue
from sva_bench.analysis.catalogue import STATISTICS
from sva_bench.execution import noise
from sva_bench.execution.engines.ideal import Ideal
from sva_bench.execution.following import follow
from sva_bench.execution.noise import SOURCES, draw_noise
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.robot.disturbance import UNDISTURBED
from sva_bench.robot.follower import stretches
from sva_bench.robot.model import BUILT_IN
from sva_bench.study.options import Options
from sva_bench.study.run import run
from sva_bench.world.noise import REALISTIC
from tests.worlds_for_tests import world_of

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")


def example(title: str) -> dict[str, Any]:
    """What the block of code under a heading defines."""
    section = PAGE[PAGE.index(f"## {title}\n"):]
    block = re.search(r"```python\n(.*?)```", section, re.DOTALL)
    assert block is not None
    names: dict[str, Any] = {}
    exec(compile(block[1], "docs/extending.md", "exec"), names)
    return names


def test_the_statistic_of_the_page_shows_in_the_summary_and_the_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(catalogue, "STATISTICS", (*STATISTICS, example("A statistic")["entry"]))
    options = Options(trials=200, rollouts=2, fidelity="kinematic")
    done = run(world_of(tmp_path), options, tmp_path / "runs", None, lambda *_: None)
    half, _ = json.loads((done.folder / "summary.json").read_text())["scenarios"]
    # uv2 is available in half of the missions, and uv1 always.
    assert 0.4 < half["plans"]["stochastic"]["statistics"]["everybody_home"]["mean"] < 0.6
    assert "everybody" in (done.folder / "report.html").read_text()


def test_the_engine_of_the_page_takes_longer_than_the_ideal_one() -> None:
    model = BUILT_IN["turtlebot2"]
    nothing = Obstacles(bounds_m=np.array([-9.0, -9, 9, 9]), boxes=np.empty((0, 5)), cylinders=np.empty((0, 3)))
    hop = stretches(np.array([[0.0, 0.0], [6.0, 0.0]]), 0.0)
    times = [follow(engine(nothing, model, (0.0, 0.0, 0.0), UNDISTURBED), model, hop)
             for engine in (Ideal, example("An engine")["Slippery"])]
    assert all(arrived for _, arrived in times)
    # At 95 % of the speed the way takes 1 / 0.95 of the time, but for speeding up and slowing down.
    assert 1.03 < times[1][0] / times[0][0] < 1.06


def test_the_source_of_noise_of_the_page_slows_robots_down_and_no_other_source_is_changed(
    monkeypatch: pytest.MonkeyPatch
) -> None:
    before = [draw_noise(REALISTIC, 0, rollout, 0) for rollout in range(200)]
    monkeypatch.setattr(noise, "SOURCES", {**SOURCES, "speed": example("A source of noise")["Sagging"]()})
    draw_noise.cache_clear()
    after = [draw_noise(REALISTIC, 0, rollout, 0) for rollout in range(200)]
    draw_noise.cache_clear()
    wheels = [draw_noise(replace(REALISTIC, speed_gain_sd=0.0), 0, rollout, 0) for rollout in range(200)]
    slower = [a.disturbance.wheel_gains[0] / w.disturbance.wheel_gains[0] for a, w in zip(after, wheels, strict=True)]
    assert max(slower) <= 1
    assert np.mean(slower) == pytest.approx(0.98, abs=0.006)  # 0.02 on average; 200 draws give it to 0.0014
    for mine, other in zip(before, after, strict=True):
        assert replace(mine.disturbance, wheel_gains=(1.0, 1.0)) == replace(other.disturbance, wheel_gains=(1.0, 1.0))
        assert mine.capacity == other.capacity


@pytest.mark.parametrize("path", sorted(set(re.findall(r"`((?:execution|mission|world|solver|analysis)/[a-z_/]+\.py)`",
                                                       PAGE))))
def test_every_module_that_the_page_names_is_there(path: str) -> None:
    assert (ROOT / "sva_bench" / path).is_file()


@pytest.mark.parametrize("path", sorted(set(re.findall(r"`(tests/[a-z_/]+(?:\.py)?)`", PAGE))))
def test_every_test_that_the_page_names_is_there(path: str) -> None:
    assert (ROOT / path).exists()
