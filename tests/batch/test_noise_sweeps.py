"""Sweeps over noise: every key may be varied, each value is executed as such, and what is the same is driven once."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from sva_bench.batch.sweep import Sweep, grid_of, varied
from sva_bench.errors import BadInput
from sva_bench.world.noise import REALISTIC, Noise
from tests.commands_for_tests import sva_bench
from tests.worlds_for_tests import SMALL

DOOR = "passages:\n  gap: {at_m: [[3.0, 2.6], [3.0, 6.0]], blocked: 0.0, wait_s: 20}\n"
KEYS: dict[str, list[Any]] = {
    "noise.wheel_gain_sd": [0.0, 0.02], "noise.speed_gain_sd": [0.0, 0.02], "noise.track_gain_sd": [0.0, 0.02],
    "noise.localisation": [None, {"sd_m": 0.03, "length_m": 0.5}], "noise.delay_s": [[0, 0], [0.03, 0.12]],
    "noise.capacity_sd": [0.0, 0.05], "noise.capacity_fade": [[0, 0], [0, 0.2]], "noise.payload_kg": [[0, 0], [1, 2]],
    "noise.hull_friction": [0.0, 0.4], "noise.people": [None, {"per_m": 0.1, "stop_s": 3}],
    "noise": [{}, "realistic"], "passages.gap.blocked": [0.0, 0.3], "passages.gap.wait_s": [0.0, 20.0]}


def world(folder: Path, noise: str = "{}") -> Path:
    path = folder / "small.world.yaml"
    path.write_text(SMALL.replace("{wheel_gain_sd: 0.01}", noise) + DOOR, encoding="utf-8")
    return path


@pytest.mark.parametrize("key", KEYS)
def test_every_key_of_noise_may_be_varied(tmp_path: Path, key: str, caplog: pytest.LogCaptureFixture) -> None:
    path = world(tmp_path)
    if key == "passages.gap.wait_s":
        path.write_text(path.read_text().replace("blocked: 0.0", "blocked: 0.5"), encoding="utf-8")
    grid = grid_of(Sweep(worlds=(path,), vary={key: KEYS[key]}, fidelity="rollout"))
    first, second = ((point.world.noise, point.world.passages) for point in grid.points)
    assert first != second
    assert caplog.messages == []  # none changes nothing


def test_values_on_the_command_line_are_those_of_a_world_file(tmp_path: Path) -> None:
    path = world(tmp_path, "realistic")
    grid = grid_of(Sweep(worlds=(path,), vary=varied([
        "noise.capacity_sd=0,0.05", "noise.localisation.sd_m=0.02,0.05"])))
    assert [(p.world.noise.capacity_sd, p.world.noise.localisation.sd_m)  # type: ignore[union-attr]
            for p in grid.points] == [(0.0, 0.02), (0.0, 0.05), (0.05, 0.02), (0.05, 0.05)]
    assert all(p.world.noise.speed_gain_sd == REALISTIC.speed_gain_sd for p in grid.points)
    (calm, loud) = grid_of(Sweep(worlds=(path,), vary=varied(["noise={},realistic"]))).points
    assert (calm.world.noise, loud.world.noise) == (Noise(), REALISTIC)


def test_a_heading_with_nothing_below_may_be_varied_too(tmp_path: Path) -> None:
    path = world(tmp_path, "")
    assert [p.world.noise for p in grid_of(Sweep(worlds=(path,), vary={"noise.capacity_sd": [0.0, 0.1]})).points] == [
        Noise(), Noise(capacity_sd=0.1)]


@pytest.mark.parametrize(("key", "value", "says"), [
    ("passages.gip.blocked", 0.5, "there is no passage 'gip'; did you mean 'gap'"),
    ("noise.capacity_sd", 0.5, "expected at most 0.2"), ("noise.delay_s", [0.1, 0.2], "at most 0.15 s"),
    ("noise.capacity", 0.1, "did you mean 'capacity_sd'"), ("noise", "wild", "realistic"),
    ("noise.localisation", {"sd_m": 0.5, "length_m": 1}, "at most 0.2 of length_m")])
def test_a_bad_value_is_refused_by_the_option(tmp_path: Path, key: str, value: Any, says: str) -> None:
    with pytest.raises(BadInput, match=f"--set {key}.*{says}"):
        grid_of(Sweep(worlds=(world(tmp_path),), vary={key: [value]}))


@pytest.mark.long
def test_points_that_differ_in_tanks_and_doors_alone_share_their_drives_and_not_their_outcomes(tmp_path: Path) -> None:
    tight = world(tmp_path)
    tight.write_text(tight.read_text().replace("fuel_capacity_s: 60", "fuel_capacity_s: 48"), encoding="utf-8")
    done = sva_bench("batch", tight, "--trials", 40, "--rollouts", 8, "--fidelity", "kinematic", "--cache", "cache",
                     "--out", "out", "--workers", 1, "--set", "noise.capacity_sd=0,0.15", "--set",
                     "passages.gap.blocked=0,0.5", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    table = pa.concat_tables(pq.read_table(path) for path in sorted((tmp_path / "out").glob("*.parquet")))
    rows = table.group_by(["variant"]).aggregate([("waited_s", "sum"), ("fuel_used_s", "sum"), ("value", "sum")])
    found = {row["variant"]: row for row in rows.to_pylist()}
    assert len(found) == 4
    for variant, row in found.items():
        assert (row["waited_s_sum"] > 0) == ("blocked=0.5" in variant)
    calm, weak = (next(row for variant, row in found.items() if f"sd={sd}" in variant and "blocked=0.5" not in variant)
                  for sd in ("0;", "0.15;"))
    assert calm["fuel_used_s_sum"] != weak["fuel_used_s_sum"]  # some tanks ran dry
