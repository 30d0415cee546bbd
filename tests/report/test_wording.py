"""How figures are told."""

from __future__ import annotations

import pytest

from sva_bench.report.wording import per_cent


@pytest.mark.parametrize(("figure", "said"), [
    (42.5, "43 %"), (-42.5, "-43 %"), (43.5, "44 %"), (9.95, "10 %"), (9.94, "9.9 %"), (0.0, "0 %"), (18.4, "18 %"),
    (None, "")])
def test_shares_are_rounded_as_readers_round_them(figure: float | None, said: str) -> None:
    assert per_cent(figure) == said
