"""Pictures of worlds are titled by the plan that they show."""

from __future__ import annotations

from pathlib import Path

import pytest

from sva_bench.mission.plan import Plan
from sva_bench.study.pictures import picture_of
from tests.worlds_for_tests import SMALL, world_of

ROUTES = {"uv1": ("base", "p1", "base")}


@pytest.mark.parametrize(("plan", "file", "title"), [
    (None, None, "small"),
    (Plan(routes=ROUTES, objective="stochastic", value=70.25), "p.json", "small: stochastic plan, promised 70.25"),
    (Plan(routes=ROUTES, objective="deterministic"), "p.json", "small: deterministic plan"),
    (Plan(routes=ROUTES), "by $hand$.csv", r"small: plan by \$hand\$"),
    (Plan(routes=ROUTES), "a" * 60 + ".json", "small: plan " + "a" * 40),
])
def test_a_picture_is_titled_by_its_plan(plan: Plan | None, file: str | None, title: str, tmp_path: Path) -> None:
    world = world_of(tmp_path, SMALL)
    picture = picture_of(world, "svg", roadmap=False, paths=False, progress=lambda *_: None, plan=plan,
                         plan_file=None if file is None else Path(file)).decode()
    # Letters are drawn as shapes, and what they say stands before them.
    assert f"<!-- {title} -->" in picture
