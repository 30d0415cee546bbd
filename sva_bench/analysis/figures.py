"""Figures of executed plans, parted into what failures left and what noise took of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sva_bench.analysis.moments import Bounds, Figure, figure_of
from sva_bench.analysis.unseen import UNHAPPY, exposure_of
from sva_bench.arrays import FloatArray
from sva_bench.choices import ENDS, End
from sva_bench.execution.execute import Executed
from sva_bench.execution.margins import Margins


def value_figure(run: Executed, *, noisy: bool) -> Figure:
    """What a plan's team collects."""
    low, high = zip(*(_collected(run, m) for m in range(run.incentive.shape[1])), strict=True)
    most = _exposed(run, run.margins, noisy=noisy)
    return figure_of(run.drawn_incentive.sum(axis=1), (sum(low), sum(high)),
                     (run.drawn_incentive - run.incentive).sum(axis=1), (0.0, most), run.rollout, noisy=noisy)


def difference_figure(a: Executed, b: Executed, *, noisy: bool) -> Figure:
    """What one plan's team collects beyond another's, trial by trial."""
    robots = range(a.incentive.shape[1])
    low, high = zip(*(_collected_beyond(a, b, m) for m in robots), strict=True)
    # A robot with the same route in both is taken the same from both.
    apart = [m for m in robots if _routes(a, m) != _routes(b, m)]
    most_a, most_b = (_exposed(run, [r for r in run.margins if r.robot in apart], noisy=noisy) for run in (a, b))
    drawn = (a.drawn_incentive - b.drawn_incentive).sum(axis=1)
    return figure_of(drawn, (sum(low), sum(high)), drawn - (a.incentive - b.incentive).sum(axis=1), (-most_b, most_a),
                     a.rollout, noisy=noisy)


def end_figures(run: Executed, robot: int, *, noisy: bool) -> dict[End, Figure]:
    """In how many trials a robot's mission ended which way, for each end."""
    availability = _availability(run, robot)
    doubtful = 0 < availability < 1
    reached = exposure_of([r for r in run.margins if r.robot == robot], run.incentive.shape[1], noisy=noisy).ends[robot]
    by_noise = np.isin(run.end[:, robot], [ENDS.index(end) for end in UNHAPPY])
    figures: dict[End, Figure] = {}
    for end in ENDS:
        happened = run.end[:, robot] == ENDS.index(end)
        if end in UNHAPPY:
            drawn, most = np.zeros_like(happened), 0.0 if availability <= 0 else float(reached[UNHAPPY.index(end)])
            bounds = -most, 0.0
        else:  # what the draw alone would have made of it; noise takes from both
            drawn = happened | by_noise & (run.available[:, robot] == (end == "home"))
            possible = doubtful if end == "failed" else availability > 0
            bounds = 0.0, min(1.0, float(reached.sum())) if possible else 0.0
        sure = float(drawn.min()), float(drawn.max())
        taken = drawn.astype(np.float64) - happened
        figures[end] = figure_of(drawn.astype(np.float64), (0.0, 1.0) if doubtful and end not in UNHAPPY else sure,
                                 taken, bounds, run.rollout, noisy=noisy)
    return figures


def _exposed(run: Executed, margins: Sequence[Margins], *, noisy: bool) -> float:
    """What a draw that was not met might take on average over failures, at most."""
    exposed = exposure_of(margins, run.incentive.shape[1], noisy=noisy).incentive
    return float(exposed @ [_availability(run, m) for m in range(len(exposed))])


def _availability(run: Executed, robot: int) -> float:
    return run.case.scenario.availability[run.robots[robot]]


def _routes(run: Executed, robot: int) -> list[tuple[str, ...]]:
    return [route.route for route in run.margins if route.robot == robot]


def _prefixes(run: Executed, robot: int, length: int) -> FloatArray:
    """What a robot has collected when it fails before its (k + 1)th POI, a row per route, shape (routes, length)."""
    found = [route.collected for route in run.margins if route.robot == robot]
    rows = [np.pad(row, (0, length - len(row)), mode="edge") for row in found] or [np.zeros(length)]
    return np.array(rows)


def _collected(run: Executed, robot: int) -> Bounds:
    """Least and greatest that failures can leave of a robot's routes."""
    return _collected_beyond(run, None, robot)


def _collected_beyond(a: Executed, b: Executed | None, robot: int) -> Bounds:
    """Least and greatest difference that failures can leave between a robot's routes in two plans."""
    availability = _availability(a, robot)
    if availability <= 0:
        return 0.0, 0.0
    runs = [run for run in (a, b) if run is not None]
    length = max((len(route.collected) for run in runs for route in run.margins if route.robot == robot), default=1)
    first = _prefixes(a, robot, length)
    second = np.zeros((1, length)) if b is None else _prefixes(b, robot, length)
    apart = first[:, None, :] - second[None, :, :]
    kept = apart[..., -1:] if availability >= 1 else apart
    return float(kept.min()), float(kept.max())
