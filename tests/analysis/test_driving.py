"""How drives were made, in a sentence."""

from __future__ import annotations

from sva_bench.analysis.driving import DrivesMade, driving_told


def test_checks_without_a_worst_one_are_left_out_of_the_sentence() -> None:
    # A folder that somebody edited may say so; its report is made all the same.
    made = DrivesMade(unit="routes", count=3, in_physics_pct=5.0, checked=2, worst_check_pct=None, tipped_over=0)
    assert driving_told(made) == "5 % of the driving time of 3 routes in physics"
