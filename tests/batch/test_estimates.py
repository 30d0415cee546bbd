"""``batch --dry-run`` against what the same batch takes, with caches cold and warm."""

from __future__ import annotations

import json
import resource
from pathlib import Path

import pytest

from tests.commands_for_tests import sva_bench_alone
from tests.worlds_for_tests import SMALL


def processor_s() -> float:
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


@pytest.mark.long  # figures of a small world on a busy machine: a factor of three is what can be held to
def test_estimates_are_near_what_a_batch_takes_with_caches_cold_and_warm(tmp_path: Path) -> None:
    (tmp_path / "w.yaml").write_text(SMALL)
    batch = ("batch", "w.yaml", "--trials", 500, "--seed", "0-1", "--set", "robots.uv2.fuel_capacity_s=40,60",
             "--cache", "cache")
    for folder in ("cold", "warm"):
        told = sva_bench_alone(*batch, "--dry-run", "--json", cwd=tmp_path)
        assert told.returncode == 0, told.stderr
        before = processor_s()
        assert sva_bench_alone(*batch, "--out", folder, "--workers", 1, "--json", cwd=tmp_path).returncode == 0
        taken = processor_s() - before
        assert taken / 3 <= json.loads(told.stdout)["processor_s"] <= 3 * taken, folder
