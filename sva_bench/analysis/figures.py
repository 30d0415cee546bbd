"""Figures of executed plans, as the part due to the failures drawn less the losses due to noise."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from sva_bench.analysis.moments import Bounds, Figure, figure_of
from sva_bench.analysis.shifts import home_shift, value_shift
from sva_bench.analysis.unseen import EXECUTION_LOSSES, exposure_of
from sva_bench.arrays import FloatArray
from sva_bench.choices import ENDS, End
from sva_bench.execution.executed import Executed
from sva_bench.execution.margins import Margins


def value_figure(run: Executed, *, noisy: bool) -> Figure:
    """The value of a plan's team in a trial."""
    low, high = zip(*(_value(run, m) for m in range(run.value.shape[1])), strict=True)
    taken = mean_taken(run, run.margins, noisy=noisy)
    return figure_of(run.drawn_value.sum(axis=1), (sum(low), sum(high)),
                     (run.drawn_value - run.value).sum(axis=1), taken, run.rollout, noisy=noisy,
                     certain=_possible(run, range(run.value.shape[1])))


def difference_figure(a: Executed, b: Executed, *, noisy: bool) -> Figure:
    """The difference in value between two plans, trial by trial."""
    robots = range(a.value.shape[1])
    low, high = zip(*(_value_beyond(a, b, m) for m in robots), strict=True)
    # A robot with the same route in both plans has the same losses in both.
    different = [m for m in robots if _routes_of(a, m) != _routes_of(b, m)]
    (least_a, most_a), (least_b, most_b) = (
        mean_taken(run, [r for r in run.margins if r.robot in different], noisy=noisy) for run in (a, b))
    (low_a, high_a), (low_b, high_b) = (_possible(run, different) for run in (a, b))
    drawn = (a.drawn_value - b.drawn_value).sum(axis=1)
    return figure_of(drawn, (sum(low), sum(high)), drawn - (a.value - b.value).sum(axis=1),
                     (least_a - most_b, most_a - least_b), a.rollout, noisy=noisy,
                     certain=(low_a - high_b, high_a - low_b))


def end_figures(run: Executed, robot: int, *, noisy: bool) -> dict[End, Figure]:
    """The share of trials in which a robot's mission had each end."""
    most, is_uncertain = run.terms.most(robot), not run.terms.certain(robot)
    margins = [r for r in run.margins if r.robot == robot]
    reached = exposure_of(margins, run.value.shape[1], noisy=noisy).ends[robot]
    later = home_shift(margins, run.terms.rate_of(robot), noisy=noisy)
    figures: dict[End, Figure] = {}
    for end in ENDS:
        happened = run.end[:, robot] == ENDS.index(end)
        if end in EXECUTION_LOSSES:
            drawn = np.zeros_like(happened)
            bounds = 0.0 if most <= 0 else -float(reached[EXECUTION_LOSSES.index(end)]), 0.0
        else:  # the end under the failures drawn alone, without noise
            drawn = run.drawn_failed[:, robot] == (end == "failed")
            possible = is_uncertain if end == "failed" else most > 0
            lost, (least, greatest) = min(1.0, float(reached.sum())) if possible else 0.0, later
            bounds = (least, lost + greatest) if end == "home" else (-greatest, lost - least)
            if end == "failed" and run.terms.survival is None and run.terms.rate is None:
                bounds = 0.0, 0.0  # a robot that fails for the whole mission never leaves: no noise changes that
        observed = float(drawn.min()), float(drawn.max())
        taken = drawn.astype(np.float64) - happened
        drawn_bounds = (0.0, 1.0) if is_uncertain and end not in EXECUTION_LOSSES else observed
        figures[end] = figure_of(drawn.astype(np.float64), drawn_bounds,
                                 taken, bounds, run.rollout, noisy=noisy, certain=(0.0, 1.0))
    return figures


def bad_figure(run: Executed, *, noisy: bool) -> Figure:
    """The share of trials in which some robot ended by what the execution made of the plan: dry, late or stuck."""
    happened: FloatArray = np.isin(run.end, [ENDS.index(end) for end in EXECUTION_LOSSES]).max(axis=1).astype(
        np.float64)
    reached = exposure_of(run.margins, run.value.shape[1], noisy=noisy).ends
    most = sum(float(reached[m].sum()) for m in range(len(reached)) if run.terms.most(m) > 0)
    return figure_of(np.zeros(len(happened)), (0.0, 0.0), -happened, (-min(1.0, most), 0.0), run.rollout,
                     noisy=noisy, certain=(0.0, 1.0))


def mean_taken(run: Executed, margins: Sequence[Margins], *, noisy: bool) -> Bounds:
    """Bounds on the mean loss, over failures, in a noise draw that was not observed."""
    exposed = exposure_of(margins, run.value.shape[1], noisy=noisy).value
    shifts = [value_shift([r for r in margins if r.robot == m], run.terms.rate_of(m), noisy=noisy)
              for m in range(len(exposed))]
    most = float(exposed @ [run.terms.most(m) for m in range(len(exposed))])
    return sum(low for low, _ in shifts), most + sum(high for _, high in shifts)


def _routes_of(run: Executed, robot: int) -> list[tuple[str, ...]]:
    return [route.route for route in run.margins if route.robot == robot]


def _value_by_failure(run: Executed, robot: int, length: int) -> FloatArray:
    """Value of a robot that fails before its (k + 1)th POI, a row per route, shape (routes, length).

    The last column, and those beyond the POIs of a route, are of a robot that doesn't fail. One that fails at constant
    rate may have visited all POIs, so there is one column more.
    """
    cost = 0.0 if run.terms.loss_cost is None else float(run.terms.loss_cost[robot])
    rows = []
    for route in run.margins:
        if route.robot == robot:
            left = route.collected - cost
            left = np.append(left if run.terms.rate_of(robot) else left[:-1], route.collected[-1])
            rows.append(np.pad(left, (0, length - len(left)), mode="edge"))
    return np.array(rows or [np.zeros(length)])


def _value(run: Executed, robot: int) -> Bounds:
    """Least and greatest value of a robot's routes over all failures."""
    return _value_beyond(run, None, robot)


def _possible(run: Executed, robots: Iterable[int]) -> Bounds:
    """Least and greatest value of some robots in a trial: all POIs of a route, and the cost of each robot's loss.

    A robot that is never available collects nothing, and costs something only where it fails along its route.
    """
    low = high = 0.0
    for robot in robots:
        routes = [route for route in run.margins if route.robot == robot]
        if run.terms.most(robot) > 0:
            high += max((float(route.collected[-1]) for route in routes), default=0.0)
        if run.terms.most(robot) > 0 or run.terms.loss_cost is not None:
            low -= max((route.loss_cost for route in routes), default=0.0)
    return low, high


def _value_beyond(a: Executed, b: Executed | None, robot: int) -> Bounds:
    """Least and greatest difference between a robot's routes in two plans over all failures."""
    if a.terms.most(robot) <= 0 and a.terms.loss_cost is None:
        return 0.0, 0.0
    runs = [run for run in (a, b) if run is not None]
    length = 1 + max((len(route.collected) for run in runs for route in run.margins if route.robot == robot), default=1)
    first = _value_by_failure(a, robot, length)
    second = np.zeros((1, length)) if b is None else _value_by_failure(b, robot, length)
    different = first[:, None, :] - second[None, :, :]
    if a.terms.certain(robot) and a.terms.most(robot) > 0:
        different = different[..., -1:]
    elif a.terms.rate_of(robot) and b is not None and _routes_of(a, robot) != _routes_of(b, robot):
        # A lifetime may end on any leg of the one route and on any of the other.
        return float(first.min() - second.max()), float(first.max() - second.min())
    return float(different.min()), float(different.max())
