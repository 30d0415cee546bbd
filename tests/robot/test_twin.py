"""Legs that share a beginning take the same time, to the bit, as if each were driven by itself."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sva_bench.arrays import FloatArray
from sva_bench.robot import twin
from sva_bench.robot.follower import Stretch, stretches
from sva_bench.robot.model import BUILT_IN, RobotModel
from sva_bench.robot.twin import drive, leg_times

POSE = np.array([0.0, 0.0, 0.3])


def courses_of(paths: list[FloatArray], headings: list[float]) -> list[tuple[Stretch, ...]]:
    return [stretches(path, heading) for path, heading in zip(paths, headings, strict=True)]


def branches(rng: np.random.Generator, legs: int) -> list[FloatArray]:
    """Paths from one place, each of which leaves another one at a vertex of it, or ends there."""
    paths = [np.zeros((1, 2))]
    for _ in range(legs):
        stem = paths[rng.integers(len(paths))]
        stem = stem[:rng.integers(1, len(stem) + 1)]
        turns = np.cumsum(rng.normal(0.0, rng.choice([0.05, 0.5, 1.5]), rng.integers(1, 12)))
        lengths = rng.choice([0.02, 0.2, 1.0, 4.0], (len(turns), 1))
        paths.append(np.concatenate([stem, stem[-1] + np.cumsum(
            lengths * np.column_stack([np.cos(turns), np.sin(turns)]), axis=0)]))
        if rng.random() < 0.3 and len(stem) > 1:
            paths.append(stem)
    return paths[1:]


@pytest.mark.parametrize("model", BUILT_IN.values(), ids=BUILT_IN.keys())
def test_legs_with_shared_beginnings_take_the_same_times_as_one_by_one(model: RobotModel) -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        paths = branches(rng, 12)
        courses = courses_of(paths, rng.uniform(-3, 3, len(paths)).tolist())
        alone = [drive(model, course, POSE.copy())[0] for course in courses]
        assert leg_times(model, courses, POSE).tolist() == alone


def test_the_shared_beginning_is_driven_once(monkeypatch: pytest.MonkeyPatch) -> None:
    # 100 m that 10 legs share, and then 1 m each: 110 m and what they see ahead of them, not 1010 m.
    paths = [np.array([[0.0, 0.0], [100.0, 0.0], [101.0, 0.05 * k]]) for k in range(10)]
    steps = 0
    driven = twin._drive

    def counting(*given: Any) -> int:
        nonlocal steps
        reached: int = driven(*given)
        steps += reached - given[-4]  # the step that it begins with
        return reached

    monkeypatch.setattr(twin, "_drive", counting)
    model = BUILT_IN["turtlebot2"]
    times = leg_times(model, courses_of(paths, [0.0] * 10), POSE)
    assert np.isfinite(times).all()
    assert steps < 0.2 * 60 * times.sum()


def test_a_leg_that_never_arrives_does_not_keep_others_from_it(monkeypatch: pytest.MonkeyPatch) -> None:
    # With no patience to speak of, the long way is given up; the short one, which shares its beginning, is not.
    monkeypatch.setattr(twin, "patience_steps", lambda *_: 600)
    paths = [np.array([[0.0, 0.0], [1.0, 0.0], [40.0, 0.1]]), np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.1]])]
    model = BUILT_IN["turtlebot2"]
    times = leg_times(model, courses_of(paths, [0.0, 0.0]), POSE)
    assert times[0] == np.inf
    assert times[1] == drive(model, courses_of(paths, [0.0, 0.0])[1], POSE.copy())[0] < 10
