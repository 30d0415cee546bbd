"""Chao's team-orienteering instances: processor time, proofs, and values beside the published best ones.

Run: ``python -m benchmarks.solver.chao --data DIR [--out results.csv] [--time-limit S] [--limit N]``. Nothing is
shipped: DIR holds the files (``p1.2.b.txt``), or instances in our format (``p1.2.b.json``), and may hold ``best.csv``,
with a header ``instance,best`` and the published best values (``published.py``).

A file has the lines ``n 32`` (places), ``m 2`` (vehicles) and ``tmax 5.0`` (their limit), then a line ``x y score`` for
each place: the first is the start, the last the end. Our model has one base. Where start and end differ, legs from the
base are those from the start, and legs to the base those to the end: times then differ by direction, and routes are the
published ones. Distances are exact; published values may come from rounded ones.

Source:
    Chao, Golden, Wasil (1996), "The team orienteering problem", EJOR 88, 464-474.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from benchmarks.solver.published import NotServed, main
from sva_bench.mission.instance import Instance, Vehicle
from sva_bench.mission.instance_file import read_instance

PATTERNS = ("p*.txt", "p*.json", "tsiligirides_*.json")
HEAD = ("n", "m", "tmax")


def read_chao(path: Path) -> Instance:
    """An instance of Chao's format, or of ours.

    Raises:
        NotServed: If the file is in neither.
    """
    if path.suffix == ".json":
        return read_instance(path)
    text = path.read_text(encoding="utf-8").replace(";", " ")
    lines = [words for line in text.splitlines() if (words := line.split())]
    try:
        if tuple(words[0] for words in lines[:3]) != HEAD:
            raise NotServed(f"{path.name}: expected the lines n, m and tmax, then places")
        n, vehicles, limit_s = int(lines[0][1]), int(lines[1][1]), float(lines[2][1])
        places = np.array([[float(word) for word in words[:3]] for words in lines[3:]])
    except (ValueError, IndexError) as error:
        raise NotServed(f"{path.name}: {error}") from error
    if places.shape != (n, 3) or n < 2:
        raise NotServed(f"{path.name}: expected {n} lines x y score for start, POIs and end, found {len(places)}")
    at, scores = places[:, :2], places[:, 2]
    distance = np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1))
    fuel = distance[:-1, :-1].copy()
    fuel[:, 0] = distance[:-1, -1]
    fuel[0, 0] = 0.0
    team = tuple(Vehicle(name=f"v{k + 1}", fuel_capacity_s=math.inf, mission_limit_s=limit_s, availability=1.0,
                         incentives=np.array([0.0, *scores[1:-1]]), fuel_s=fuel) for k in range(vehicles))
    return Instance(name=path.stem, sites=("base", *(f"p{k}" for k in range(1, n - 1))), base=0, stations=(),
                    stop_s=np.zeros(n - 1), vehicles=team)


if __name__ == "__main__":
    main(__doc__ or "", PATTERNS, read_chao)
