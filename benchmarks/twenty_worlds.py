"""The VSS over twenty random worlds, five of each family, as docs/batches.md tells it: six minutes of processor time.

Run: ``python benchmarks/twenty_worlds.py``, or with ``--out FOLDER`` to keep worlds and batch.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

FAMILIES = ("rooms", "field", "aisles", "maze")
SEEDS = range(5)
TRIALS = 10_000


def command(*arguments: object, cwd: Path) -> None:
    """Run a command as a user would."""
    subprocess.run([sys.executable, "-m", "sva_bench", *map(str, arguments)], cwd=cwd, check=True,
                   stdout=subprocess.DEVNULL)


def measure(folder: Path) -> None:
    """Make the worlds, run the batch and print its figures."""
    names = []
    for family in FAMILIES:
        for seed in SEEDS:
            names.append(f"{family}-{seed}.yaml")
            command("world", "random", "--family", family, "--pois", 10, "--seed", seed, "-o", names[-1], cwd=folder)
    command("batch", *names, "--trials", TRIALS, "--workers", 1, "--out", "batch", "--cache", "cache", cwd=folder)
    summary = json.loads((folder / "batch" / "summary.json").read_text(encoding="utf-8"))
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"{len(names)} worlds, {TRIALS} trials, {len(os.sched_getaffinity(0))} cores, load {os.getloadavg()[0]:.1f}: "
          f"processor {used.ru_utime + used.ru_stime:.0f} s")
    for row in summary["aggregate"]:
        share, interval = row["vss_pct"]["mean"], row["vss_pct"]["ci95"]
        told = "none" if share is None else f"{share:.1f} %" + (
            "" if interval is None else f" [{interval[0]:.1f}, {interval[1]:.1f}]")
        print(f"{row['scenario']}: VSS {told} over {row['maps']} maps")


def main() -> None:
    """Measure in a folder of one's own, or a temporary one."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, help="keep worlds and batch there")
    chosen = parser.parse_args().out
    if chosen is not None:
        chosen.mkdir(parents=True, exist_ok=True)
        measure(chosen.resolve())
        return
    with tempfile.TemporaryDirectory() as name:
        measure(Path(name))


if __name__ == "__main__":
    main()
