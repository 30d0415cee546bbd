"""Speed of batches: workers against one, overhead of a unit, many trials from cached drives, Dask against local.

Processor time is told beside wall-clock time, for a shared machine. Run: ``python benchmarks/batch.py``.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

WORLDS = 8


def command(*arguments: object, cwd: Path) -> tuple[float, float]:
    """Wall-clock and processor time of a command with all its processes [s]."""
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    subprocess.run([sys.executable, "-m", "sva_bench", *map(str, arguments)], cwd=cwd, check=True,
                   stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.monotonic() - begun, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def worlds(folder: Path) -> list[str]:
    """Small random worlds of all families."""
    names = []
    for seed in range(WORLDS):
        names.append(f"world{seed}.yaml")
        family = ("rooms", "field", "aisles", "maze")[seed % 4]
        command("world", "random", "--family", family, "--size", 12, "--pois", 6, "--seed", seed, "-o", names[-1],
                cwd=folder)
    return names


def main() -> None:
    """Print the figures."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        names = worlds(folder)
        shared = ("--cache", "cache")

        def batch(out: str, *more: object) -> tuple[float, float]:
            return command("batch", *names, "--out", out, *shared, *more, cwd=folder)

        print(f"{len(os.sched_getaffinity(0))} cores, load {os.getloadavg()[0]:.1f}")
        wall, cpu = batch("warm", "--rollouts", 2, "--trials", 16)
        print(f"cold: travel times, plans and drives of {WORLDS} worlds: {wall:.0f} s, processor {cpu:.0f} s")

        many = ("--rollouts", 2, "--trials", 125_000)
        small = batch("small", "--rollouts", 2, "--trials", 16)
        wall, cpu = batch("many", *many)
        print(f"10^6 trials of {WORLDS} worlds, all cached: {wall:.1f} s, processor {cpu:.1f} s "
              f"(of it the program's start {small[1]:.1f} s); target 60 s; largest process "
              f"{resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e3:.0f} MB, target 1000 MB")

        few = batch("few", "--rollouts", 2, "--trials", 2000, "--unit-trials", 2000, "--workers", 1)
        cut = batch("cut", "--rollouts", 2, "--trials", 2000, "--unit-trials", 10, "--workers", 1)
        units = WORLDS * 199
        print(f"overhead per unit: {(cut[0] - few[0]) / units * 1e3:.1f} ms, processor "
              f"{(cut[1] - few[1]) / units * 1e3:.1f} ms; target 50 ms")

        physics = ("--fidelity", "physics", "--scenario", "S2", "--rollouts", 2, "--trials", 10, "--unit-trials", 1)
        one = batch("one", *physics, "--workers", 1)
        two = batch("two", *physics, "--workers", 2)
        print(f"physics: one worker {one[0]:.0f} s, two {two[0]:.0f} s: {one[0] / two[0]:.2f} times; target 1.7; "
              f"processor {one[1]:.0f} and {two[1]:.0f} s")

        file = folder / "scheduler.json"
        parts = [["dask_scheduler", "--port", "0"], *[["dask_worker", "--nthreads", "1", "--no-nanny"]] * 2]
        cluster = [subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.{part[0]}", "--host", "127.0.0.1", "--no-dashboard",
             "--scheduler-file", str(file), *part[1:]], cwd=folder, stderr=subprocess.DEVNULL) for part in parts]
        try:
            while not file.exists():
                time.sleep(0.1)
            dask = batch("dask", *physics, "--dask", file)
        finally:
            for process in cluster:
                process.kill()
        print(f"Dask with two workers {dask[0]:.0f} s: {dask[0] / two[0]:.2f} times local; target 1.2")


if __name__ == "__main__":
    main()
