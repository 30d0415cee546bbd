"""OPLib's orienteering instances: processor time, proofs, and values beside the published best ones.

Run: ``python -m benchmarks.solver.oplib --data DIR [--out results.csv] [--time-limit S] [--limit N]``. Nothing is
shipped: DIR holds the files (``*.oplib``), and may hold ``best.csv``, with a header ``instance,best`` and the published
best values (``published.py``).

A file is of TSPLIB's kind, with ``COST_LIMIT``, a ``NODE_SCORE_SECTION`` (node, score) and a ``DEPOT_SECTION``, whose
first node is the base. Costs are TSPLIB's, rounded to integers as it says: ``EUC_2D``, ``CEIL_2D``, ``ATT``, ``GEO``.
Others, explicit matrices too, are skipped with the reason. Rounded costs may violate the triangle inequality; our model
doesn't need it.

Source:
    Kobeaga, Merino, Lozano (2018), "An efficient evolutionary algorithm for the orienteering problem", Computers &
    Operations Research 90, 42-59; Reinelt (1991), "TSPLIB", ORSA Journal on Computing 3, 376-384.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from benchmarks.solver.published import NotServed, main
from sva_bench.arrays import FloatArray
from sva_bench.mission.instance import Instance, Vehicle

PATTERNS = ("*.oplib",)
SECTIONS = ("NODE_COORD_SECTION", "NODE_SCORE_SECTION", "DEPOT_SECTION")
EARTH_KM = 6378.388  # TSPLIB's
PI = 3.141592  # TSPLIB's


def read_oplib(path: Path) -> Instance:
    """An instance of OPLib's format.

    Raises:
        NotServed: If its costs are of another kind, or the file is broken.
    """
    fields, sections = _parts(path)
    kind = fields.get("EDGE_WEIGHT_TYPE", "none")
    if kind not in COSTS:
        raise NotServed(f"{path.name}: costs of the type {kind}; read are {', '.join(COSTS)}")
    missing = [part for part in ("COST_LIMIT", *SECTIONS) if part not in fields and part not in sections]
    if missing:
        raise NotServed(f"{path.name}: no {' and no '.join(missing)}")
    try:
        nodes = [int(row[0]) for row in sections["NODE_COORD_SECTION"]]
        at = np.array([[float(row[1]), float(row[2])] for row in sections["NODE_COORD_SECTION"]])
        scores = {int(row[0]): float(row[1]) for row in sections["NODE_SCORE_SECTION"]}
        depot, limit_s = int(sections["DEPOT_SECTION"][0][0]), float(fields["COST_LIMIT"])
        dimension = int(fields.get("DIMENSION", len(nodes)))
    except ValueError as error:
        raise NotServed(f"{path.name}: {error}") from error
    except IndexError as error:
        raise NotServed(f"{path.name}: a line of a section that ends too soon, or a section without lines") from error
    if len(nodes) != dimension:
        raise NotServed(f"{path.name}: DIMENSION {dimension}, but {len(nodes)} nodes")
    if depot not in nodes:
        raise NotServed(f"{path.name}: the depot {depot} has no coordinates")
    for node, place in zip(nodes, at, strict=True):
        if node != depot and node not in scores:
            raise NotServed(f"{path.name}: node {node} has no score")
        if not np.isfinite(place).all() or not math.isfinite(scores.get(node, 0.0)):
            raise NotServed(f"{path.name}: node {node}: expected finite numbers for coordinates and score")
    if not limit_s >= 0:
        raise NotServed(f"{path.name}: expected a COST_LIMIT of 0 or more, found {fields['COST_LIMIT']}")
    base = nodes.index(depot)
    earned = np.array([0.0 if node == depot else scores[node] for node in nodes])
    fuel = COSTS[kind](at)
    np.fill_diagonal(fuel, 0.0)
    vehicle = Vehicle(name="v1", fuel_capacity_s=math.inf, mission_limit_s=limit_s, availability=1.0,
                      incentives=earned, fuel_s=fuel)
    return Instance(name=path.stem, sites=tuple("base" if k == base else f"p{node}" for k, node in enumerate(nodes)),
                    base=base, stations=(), stop_s=np.zeros(len(nodes)), vehicles=(vehicle,))


def _parts(path: Path) -> tuple[dict[str, str], dict[str, list[list[str]]]]:
    """The fields of a file, and the rows of its sections."""
    fields: dict[str, str] = {}
    sections: dict[str, list[list[str]]] = {}
    section: list[list[str]] | None = None
    for line in path.read_text(encoding="utf-8").splitlines():
        words = line.split()
        if not words or words[0] in ("-1", "EOF"):
            section = None
        elif words[0].rstrip(":").endswith("_SECTION"):
            section = sections.setdefault(words[0].rstrip(":"), [])
        elif section is not None:
            section.append(words)
        else:
            name, _, value = line.partition(":")
            fields[name.strip()] = value.strip()
    return fields, sections


def _euclidean(at: FloatArray) -> FloatArray:
    return np.floor(_distances(at) + 0.5)


def _ceiling(at: FloatArray) -> FloatArray:
    return np.ceil(_distances(at))


def _pseudo_euclidean(at: FloatArray) -> FloatArray:
    exact = _distances(at) / math.sqrt(10.0)
    rounded = np.floor(exact + 0.5)
    return np.asarray(np.where(rounded < exact, rounded + 1.0, rounded))


def _geographical(at: FloatArray) -> FloatArray:
    degrees = np.trunc(at)
    latitude, longitude = (PI * (degrees + 5.0 * (at - degrees) / 3.0) / 180.0).T
    q1 = np.cos(longitude[:, None] - longitude[None])
    q2 = np.cos(latitude[:, None] - latitude[None])
    q3 = np.cos(latitude[:, None] + latitude[None])
    cosine = np.clip(0.5 * ((1.0 + q1) * q2 - (1.0 - q1) * q3), -1.0, 1.0)
    return np.asarray(np.trunc(EARTH_KM * np.arccos(cosine) + 1.0))


def _distances(at: FloatArray) -> FloatArray:
    between: FloatArray = np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1))
    return between


COSTS = {"EUC_2D": _euclidean, "CEIL_2D": _ceiling, "ATT": _pseudo_euclidean, "GEO": _geographical}
"""Costs between places, shape (n, 2), by TSPLIB's name."""


if __name__ == "__main__":
    main(__doc__ or "", PATTERNS, read_oplib)
