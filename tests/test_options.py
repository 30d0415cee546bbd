"""What a run was told, from its manifest back to the same run."""

from __future__ import annotations

import json
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest

import sva_bench as sb
from sva_bench.analysis.precision import Precision
from sva_bench.solver.two_stage import SolveLimits
from sva_bench.storage.run_folder import run_name
from sva_bench.study.options import Options
from tests.worlds_for_tests import world_of

OTHER: dict[str, Any] = {
    "seed": 3, "trials": 7, "rollouts": 5, "fidelity": "kinematic", "planner": "fmt", "evpi": True, "informed": True,
    "limits": SolveLimits(time_limit_s=2.5, gap=0.01), "assumptions": True, "policies": ("none", "resolve"),
    "news": ("report", "instant"), "anticipate": True, "calibrate": 0.015,
    "precision": Precision(pct=1.5, max_trials=70, anytime=True)}


# What is recorded changes no result; the manifest names the recordings.
@pytest.mark.parametrize("name", [field.name for field in fields(Options) if field.name != "record"])
def test_every_option_survives_the_way_through_a_file(name: str) -> None:
    told = replace(Options(), **{name: OTHER[name]})
    assert told.as_dict() != Options().as_dict() or name == "seed"
    again = Options.from_dict(told.seed, json.loads(json.dumps(told.as_dict())))
    for field in fields(Options):
        assert getattr(again, field.name) == getattr(told, field.name), field.name


def test_a_manifest_tells_all_that_the_name_of_its_run_depends_on(tmp_path: Path) -> None:
    folder = sb.run(world_of(tmp_path), trials=10, rollouts=2, fidelity="kinematic", workers=1, seed=4, gap=0.001,
                    precision="500%", informed=True, scenario="half", out=tmp_path / "runs").folder
    assert folder is not None
    manifest = json.loads((folder / "manifest.json").read_text())
    options = Options.from_dict(manifest["seed"], manifest["options"])
    name = run_name("small", options.seed, {"world": manifest["world"], "options": options.as_dict()})
    assert name == folder.name
