"""What robots did to each other, mission by mission: shapes, rows, and the plans of several cases."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from sva_bench.execution.meetings import Meetings, combined_meetings

THREE = Meetings(contacts=np.array([0, 1, 0]), waited_s=np.array([0.0, 2.5, 7.5]), detours=np.array([0, 0, 3]),
                 exact=np.array([True, True, False]))


@pytest.mark.parametrize("wrong", [
    {"waited_s": np.array([0.0, 1.0])}, {"exact": np.array([True])}, {"contacts": np.array([0, 1])},
    {"waited_s": np.array([0.0, np.nan, 1.0])}, {"waited_s": np.array([0.0, -1.0, 1.0])},
    {"detours": np.array([0, -1, 0])}])
def test_what_is_of_other_missions_or_less_than_nothing_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"shape|NaN|negative"):
        replace(THREE, **wrong)


def test_nobody_changes_them_afterwards() -> None:
    own = np.array([True, True, False])
    mine = replace(THREE, exact=own)
    own[0] = False
    assert mine.exact[0]
    for array in vars(mine).values():
        assert not array.flags.writeable


def test_some_missions_keep_what_is_theirs() -> None:
    last = THREE.rows(slice(1, 3))
    assert_array_equal(last.waited_s, [2.5, 7.5])
    assert_array_equal(THREE.rows(np.array([2, 0])).detours, [3, 0])
    assert_array_equal(last.exact, [True, False])


def test_of_several_plans_each_mission_has_that_of_the_plan_it_was_driven_by() -> None:
    other = Meetings(contacts=np.array([5, 5, 5]), waited_s=np.full(3, 9.0), detours=np.array([4, 4, 4]),
                     exact=np.array([False, False, True]))
    found = combined_meetings([THREE, other], np.array([1, 0, 1]))
    assert found is not None
    assert_array_equal(found.contacts, [5, 1, 5])
    assert_array_equal(found.waited_s, [9.0, 2.5, 9.0])
    assert_array_equal(found.detours, [4, 0, 4])
    assert_array_equal(found.exact, [False, True, True])
    assert combined_meetings([None, None], np.array([1, 0, 1])) is None
