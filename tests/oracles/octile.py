"""Shortest paths on a grid as MovingAI's benchmarks mean them, eight neighbours, no corner cut; and .scen files."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import networkx

from sva_bench.arrays import BoolArray


@dataclass(frozen=True)
class Query:
    """A line of a .scen file: start and goal as column and row from the upper left, and the optimal length."""

    start: tuple[int, int]
    goal: tuple[int, int]
    length: float


def read_scen(path: Path) -> list[Query]:
    """All queries of a file."""
    lines = [line.split("\t") for line in path.read_text().splitlines()[1:]]
    return [Query(start=(int(w[4]), int(w[5])), goal=(int(w[6]), int(w[7])), length=float(w[8])) for w in lines]


def octile_length(occupied: BoolArray, start: tuple[int, int], goal: tuple[int, int]) -> float:
    """Length of the shortest path between cells given as column and row of ``occupied``, in cells."""
    rows, columns = occupied.shape
    graph = networkx.Graph()
    for r in range(rows):
        for c in range(columns):
            for dr, dc in ((0, 1), (1, 0), (1, 1), (1, -1)):
                if 0 <= r + dr < rows and 0 <= c + dc < columns and not (
                        occupied[r, c] or occupied[r + dr, c + dc] or occupied[r + dr, c] or occupied[r, c + dc]):
                    graph.add_edge((c, r), (c + dc, r + dr), weight=math.hypot(dr, dc))
    return float(networkx.dijkstra_path_length(graph, start, goal))
