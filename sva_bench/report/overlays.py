"""What a picture of a world shows beside map and sites: the types."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from sva_bench.arrays import FloatArray
from sva_bench.choices import Judgement, MarkKind
from sva_bench.report.stands import Stand

Kind = Literal["png", "svg"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Leg:
    """A leg of a route: where it ends, and the path there [m], shape (k, 2)."""

    destination: str
    path: FloatArray


@dataclass(frozen=True, kw_only=True)
class Mark:
    """What robots met about a place [m]: how many times, and whether one never got away."""

    kind: MarkKind
    x_m: float
    y_m: float
    count: int
    stuck: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class JudgedLeg:
    """A leg of a route by how safe it is: its path [m], shape (k, 2), and the judgement."""

    path: FloatArray
    judged: Judgement


@dataclass(frozen=True, eq=False, kw_only=True)
class Overlays:
    """What is shown beside map and sites.

    Attributes:
        roadmap: Both ends of each edge [m], shape (e, 2, 2).
        roadmap_of: Whose it is, where not all robots have the same.
        paths: Paths between sites [m], each of shape (k, 2).
        paths_of: Whose they are, where not all robots have the same.
        routes: Legs of each robot's route.
        marks: What robots met where.
        judged: Legs by how safe they are, the worst to be seen last.
        stands: Berths, and slots of stations.
    """

    roadmap: FloatArray | None = None
    roadmap_of: str = ""
    paths: Sequence[FloatArray] = ()
    paths_of: str = ""
    routes: Mapping[str, Sequence[Leg]] = field(default_factory=dict)
    marks: Sequence[Mark] = ()
    judged: Sequence[JudgedLeg] = ()
    stands: Sequence[Stand] = ()
