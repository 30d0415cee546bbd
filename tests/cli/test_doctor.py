"""``sva-bench doctor``: all parts tried for real, and one that is broken on purpose."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
from pathlib import Path


def doctor(**environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "sva_bench", "doctor", "--json"], text=True, capture_output=True,
                          check=False, env={**os.environ, **environment})


def test_all_that_a_run_needs_works_here() -> None:
    done = doctor()
    assert done.returncode == 0, done.stdout + done.stderr
    found = json.loads(done.stdout)
    assert found["works"]
    states = {part["part"]: part["state"] for part in found["parts"]}
    needed = ("sva-bench", "Python", "libraries", "physics", "path planner", "solver", "recordings", "machine")
    assert {states[part] for part in needed} == {"ok"}
    assert "failed" not in states.values()


def test_a_broken_library_is_named_and_the_other_parts_are_tried_all_the_same(tmp_path: Path) -> None:
    (tmp_path / "pybullet.py").write_text('raise ImportError("no such symbol")\n')
    done = doctor(PYTHONPATH=str(tmp_path))
    assert done.returncode == 1
    parts = {part["part"]: part for part in json.loads(done.stdout)["parts"]}
    assert parts["physics"]["state"] == "failed"
    assert "no such symbol" in parts["physics"]["found"]
    assert parts["solver"]["state"] == "ok"
    assert "Traceback" not in done.stderr


def test_what_is_missing_for_one_option_is_said_with_what_to_install_and_is_no_failure(tmp_path: Path) -> None:
    done = doctor(VK_ICD_FILENAMES=str(tmp_path / "none.json"), PATH=str(tmp_path))
    assert done.returncode == 0
    parts = {part["part"]: part for part in json.loads(done.stdout)["parts"]}
    assert parts["pictures"]["state"] == parts["browser"]["state"] == "missing"
    assert "mesa-vulkan-drivers" in parts["pictures"]["found"]


def test_lines_fit_eighty_columns_and_take_seconds_of_processor_time() -> None:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([sys.executable, "-m", "sva_bench", "doctor"], text=True, capture_output=True, check=False,
                          env={key: value for key, value in os.environ.items() if key != "COLUMNS"})
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert done.returncode == 0, done.stderr
    assert max(map(len, done.stdout.splitlines())) <= 80
    assert all(line.startswith(("ok ", "missing ", " ")) for line in done.stdout.splitlines())
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 10  # 1.5 s measured
