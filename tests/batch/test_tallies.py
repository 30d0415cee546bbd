"""Figures of ranges, joined, are those of the whole; those of seeds, pooled, have their draws apart."""

from __future__ import annotations

import json

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sva_bench.analysis.moments import Figure, figure_of, joined, pooled
from sva_bench.analysis.statistics import estimate
from sva_bench.batch.schema import StoredFigure
from sva_bench.batch.tallies import figure_from, stored_figure
from sva_bench.files.records import as_dict, from_dict


def part(drawn: list[float], taken: list[float], rollout: list[int]) -> Figure:
    return figure_of(np.array(drawn), (0.0, 10.0), np.array(taken), (0.0, 5.0), np.array(rollout), noisy=True)


def test_figures_of_two_halves_by_hand() -> None:
    # Drawn 1, 3 and 5, 7: mean 4, squares about it 9 + 1 + 1 + 9 = 20. Taken by draw 0: 1 + 2, by draw 1: 0 + 1.
    whole = joined(part([1, 3], [1, 0], [0, 1]), part([5, 7], [2, 1], [0, 1]))
    assert (whole.drawn.count, whole.drawn.mean, whole.drawn.squares) == (4, 4.0, 20.0)
    assert (whole.taken.counts.tolist(), whole.taken.sums.tolist()) == ([2, 2], [3.0, 1.0])
    assert whole.mean == 3.0


def test_a_range_that_did_not_meet_the_last_draws_joins_one_that_did() -> None:
    whole = joined(part([1], [1], [0]), part([5, 7], [2, 1], [1, 2]))
    assert whole.taken.counts.tolist() == [1, 1, 1]
    assert whole.taken.sums.tolist() == [1.0, 2.0, 1.0]


def test_seeds_have_draws_of_their_own() -> None:
    # The same figures, but twice as many draws: an end that none of them showed may have half of the share.
    once = part([1, 3, 5, 7], [0, 0, 0, 0], [0, 1, 2, 3])
    again = pooled(once, once)
    assert again.taken.counts.tolist() == [1] * 8
    assert again.drawn.count == 8
    narrow, wide = estimate(again).half_width, estimate(joined(once, once)).half_width
    assert narrow is not None
    assert wide is not None
    assert narrow < wide


@given(st.integers(2, 60).flatmap(lambda n: st.tuples(
    arrays(np.float64, n, elements=st.floats(0, 1e3)), arrays(np.float64, n, elements=st.floats(0, 1e3)))),
    st.integers(1, 59), st.booleans())
def test_a_joined_estimate_is_that_of_the_trials_themselves(
        values: tuple[np.ndarray, np.ndarray], cut: int, noisy: bool) -> None:
    drawn, taken = values
    cut, rollout = min(cut, len(drawn) - 1), np.arange(len(drawn)) % 4

    def figure(chosen: slice) -> Figure:
        made = figure_of(drawn[chosen], (0.0, 1e3), taken[chosen], (0.0, 1e3), rollout[chosen], noisy=noisy)
        text = json.dumps(as_dict(stored_figure(made)))  # as shards keep it
        return figure_from(from_dict(StoredFigure, json.loads(text)))

    got, want = estimate(joined(figure(slice(cut)), figure(slice(cut, None)))), estimate(figure(slice(None)))
    # Sums of up to 60 figures of up to 1e3, in another order: 1e-9 is a thousand times their rounding.
    np.testing.assert_allclose(got.mean, want.mean, atol=1e-9)
    assert got.ci95 is not None
    assert want.ci95 is not None
    np.testing.assert_allclose(got.ci95, want.ci95, atol=1e-5)
