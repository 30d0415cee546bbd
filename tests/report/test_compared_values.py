"""What the values of a varied key are said to be worth."""

from __future__ import annotations

import pytest

from sva_bench.analysis.compared_values import KeyComparison, ValueGain, ValueRow
from sva_bench.analysis.results import Estimate
from sva_bench.report.compared_values import compared_answers


def gain(mean: float, half: float) -> ValueGain:
    ends = (mean - half, mean + half)
    return ValueGain(mean=mean, ci95=ends, ci95_adjusted=ends, distinguishable=abs(mean) > half)


def said(*gains: tuple[ValueGain, ValueGain]) -> str:
    plain = Estimate(mean=1.0, ci95=(0.0, 2.0))
    rows = [ValueRow(scenario="S", others="", value=f'"x{k + 2}"', maps=12, executed=plain, vss=plain, gain=own,
                     vss_gain=vss) for k, (own, vss) in enumerate(gains)]
    (answer,) = compared_answers(KeyComparison(
        key="k", reference='"x1"', values=('"x1"', *(row.value for row in rows)), sample="maps", rows=tuple(rows)))
    return answer


EVEN = gain(3.0, 5.0)


@pytest.mark.parametrize(("gains", "answer"), [
    ([(EVEN, EVEN)], "S: what the plan collects can't be told apart from that with x1."),
    ([(EVEN, gain(-65.0, 60.0))], "S: what the plan collects can't be told apart from that with x1, but planning for "
                                  "failures is worth 65.0 less with x2 [5.0, 125.0]."),
    ([(EVEN, gain(4.0, 1.0)), (EVEN, gain(-4.0, 1.0))],
     "S: what the plan collects can't be told apart from that with x1, but planning for failures is worth 4.0 more "
     "with x2 [3.0, 5.0] and 4.0 less with x3 [3.0, 5.0]."),
    ([(gain(7.0, 1.0), gain(4.0, 1.0))], "S: x2 is worth 7.0 more than x1 [6.0, 8.0].")])
def test_where_only_the_vss_differs_that_is_said(gains: list[tuple[ValueGain, ValueGain]], answer: str) -> None:
    assert said(*gains) == answer


def test_scenarios_of_which_the_same_is_said_share_a_sentence() -> None:
    plain = Estimate(mean=1.0, ci95=(0.0, 2.0))
    rows = [ValueRow(scenario=name, others="", value='"x2"', maps=12, executed=plain, vss=plain, gain=own,
                     vss_gain=EVEN) for name, own in (("S1", EVEN), ("S2", gain(7.0, 1.0)), ("S3", EVEN))]
    assert compared_answers(KeyComparison(
        key="k", reference='"x1"', values=('"x1"', '"x2"'), sample="maps", rows=tuple(rows))) == [
        "S1 and S3: what the plan collects can't be told apart from that with x1.",
        "S2: x2 is worth 7.0 more than x1 [6.0, 8.0]."]
