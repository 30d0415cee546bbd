"""Ctrl-C in a callback of OMPL, which is no place for exceptions: it ends the search soon, and is raised then."""

from __future__ import annotations

import signal
from typing import get_args

import numpy as np
import pytest

from sva_bench.arrays import FloatArray
from sva_bench.choices import PathPlanner
from sva_bench.geometry.buckets import keeps_clear
from sva_bench.interrupts import as_ctrl_c
from sva_bench.travel import roadmap
from tests.worlds_for_tests import world_of

CALLS = 200
SOON = 20_000  # checks that planners make before they ask whether to end; whole searches make many times as many


@pytest.fixture
def where(tmp_path_factory: pytest.TempPathFactory) -> tuple[object, FloatArray]:
    world = world_of(tmp_path_factory.mktemp("world"))
    return world.obstacles, np.array([(site.x_m, site.y_m) for site in world.sites])


@pytest.mark.parametrize("planner", get_args(PathPlanner))
def test_ctrl_c_in_a_callback_ends_the_search_and_is_raised_then(
    planner: PathPlanner, where: tuple[object, FloatArray], monkeypatch: pytest.MonkeyPatch
) -> None:
    calls, raised = 0, 0

    def pressed_at(checker: FloatArray, ax: float, ay: float, bx: float, by: float) -> bool:
        nonlocal calls, raised
        calls += 1
        try:
            if calls == CALLS:
                signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            raised += 1
            raise
        return bool(keeps_clear(checker, ax, ay, bx, by))

    monkeypatch.setattr(roadmap, "keeps_clear", pressed_at)
    obstacles, points = where
    with pytest.raises(KeyboardInterrupt), as_ctrl_c():
        roadmap.plan_paths(obstacles, points, 0.3, planner=planner)  # type: ignore[arg-type]
    assert raised == 0
    assert CALLS <= calls < CALLS + SOON
