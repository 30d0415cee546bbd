"""Figures of executed plans, as the part due to the failures drawn less the losses due to noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sva_bench.analysis.moments import Bounds, Figure, figure_of
from sva_bench.analysis.unseen import EXECUTION_LOSSES, exposure_of
from sva_bench.arrays import FloatArray
from sva_bench.choices import ENDS, End
from sva_bench.execution.execute import Executed
from sva_bench.execution.margins import Margins


def value_figure(run: Executed, *, noisy: bool) -> Figure:
    """The incentive that a plan's team collects in a trial."""
    low, high = zip(*(_collected(run, m) for m in range(run.incentive.shape[1])), strict=True)
    most = _mean_exposure(run, run.margins, noisy=noisy)
    return figure_of(run.drawn_incentive.sum(axis=1), (sum(low), sum(high)),
                     (run.drawn_incentive - run.incentive).sum(axis=1), (0.0, most), run.rollout, noisy=noisy,
                     certain=(0.0, sum(_most_collected(run, m) for m in range(run.incentive.shape[1]))))


def difference_figure(a: Executed, b: Executed, *, noisy: bool) -> Figure:
    """The difference in incentive between two plans, trial by trial."""
    robots = range(a.incentive.shape[1])
    low, high = zip(*(_collected_beyond(a, b, m) for m in robots), strict=True)
    # A robot with the same route in both plans has the same losses in both.
    different = [m for m in robots if _routes_of(a, m) != _routes_of(b, m)]
    most_a, most_b = (
        _mean_exposure(run, [r for r in run.margins if r.robot in different], noisy=noisy) for run in (a, b))
    drawn = (a.drawn_incentive - b.drawn_incentive).sum(axis=1)
    return figure_of(drawn, (sum(low), sum(high)), drawn - (a.incentive - b.incentive).sum(axis=1), (-most_b, most_a),
                     a.rollout, noisy=noisy, certain=(-sum(_most_collected(b, m) for m in different) + 0.0,
                                                      sum(_most_collected(a, m) for m in different) + 0.0))


def end_figures(run: Executed, robot: int, *, noisy: bool) -> dict[End, Figure]:
    """The share of trials in which a robot's mission had each end."""
    availability = _availability(run, robot)
    is_uncertain = 0 < availability < 1
    margins = [r for r in run.margins if r.robot == robot]
    reached = exposure_of(margins, run.incentive.shape[1], noisy=noisy).ends[robot]
    by_noise = np.isin(run.end[:, robot], [ENDS.index(end) for end in EXECUTION_LOSSES])
    figures: dict[End, Figure] = {}
    for end in ENDS:
        happened = run.end[:, robot] == ENDS.index(end)
        if end in EXECUTION_LOSSES:
            drawn = np.zeros_like(happened)
            most = 0.0 if availability <= 0 else float(reached[EXECUTION_LOSSES.index(end)])
            bounds = -most, 0.0
        else:  # the end under the failures drawn alone, without noise
            drawn = happened | by_noise & (run.available[:, robot] == (end == "home"))
            possible = is_uncertain if end == "failed" else availability > 0
            bounds = 0.0, min(1.0, float(reached.sum())) if possible else 0.0
        observed = float(drawn.min()), float(drawn.max())
        taken = drawn.astype(np.float64) - happened
        drawn_bounds = (0.0, 1.0) if is_uncertain and end not in EXECUTION_LOSSES else observed
        figures[end] = figure_of(drawn.astype(np.float64), drawn_bounds,
                                 taken, bounds, run.rollout, noisy=noisy, certain=(0.0, 1.0))
    return figures


def _mean_exposure(run: Executed, margins: Sequence[Margins], *, noisy: bool) -> float:
    """Upper bound on the mean loss, over failures, in a noise draw that was not observed."""
    exposed = exposure_of(margins, run.incentive.shape[1], noisy=noisy).incentive
    return float(exposed @ [_availability(run, m) for m in range(len(exposed))])


def _availability(run: Executed, robot: int) -> float:
    return run.case.scenario.availability[run.robots[robot]]


def _routes_of(run: Executed, robot: int) -> list[tuple[str, ...]]:
    return [route.route for route in run.margins if route.robot == robot]


def _collected_by_failure(run: Executed, robot: int, length: int) -> FloatArray:
    """Incentive collected by a robot that fails before its (k + 1)th POI, a row per route, shape (routes, length)."""
    found = [route.collected for route in run.margins if route.robot == robot]
    rows = [np.pad(row, (0, length - len(row)), mode="edge") for row in found] or [np.zeros(length)]
    return np.array(rows)


def _collected(run: Executed, robot: int) -> Bounds:
    """Least and greatest incentive of a robot's routes over all failures."""
    return _collected_beyond(run, None, robot)


def _most_collected(run: Executed, robot: int) -> float:
    """The most that a robot can collect in a trial: all POIs of a route, but none if it is never available."""
    if _availability(run, robot) <= 0:
        return 0.0
    return max((float(route.collected[-1]) for route in run.margins if route.robot == robot), default=0.0)


def _collected_beyond(a: Executed, b: Executed | None, robot: int) -> Bounds:
    """Least and greatest difference between a robot's routes in two plans over all failures."""
    availability = _availability(a, robot)
    if availability <= 0:
        return 0.0, 0.0
    runs = [run for run in (a, b) if run is not None]
    length = max((len(route.collected) for run in runs for route in run.margins if route.robot == robot), default=1)
    first = _collected_by_failure(a, robot, length)
    second = np.zeros((1, length)) if b is None else _collected_by_failure(b, robot, length)
    different = first[:, None, :] - second[None, :, :]
    kept = different[..., -1:] if availability >= 1 else different
    return float(kept.min()), float(kept.max())
