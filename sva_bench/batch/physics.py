"""What a batch does where physics fails: the unit is given up, so that no figure over maps rests on it."""

from __future__ import annotations

from collections.abc import Sequence

from sva_bench.errors import BadInput
from sva_bench.execution.outcome import Driven
from sva_bench.files.printable import counted


def refuse_failed_physics(driven: Sequence[Driven]) -> None:
    """Refuse drives in which physics gave no finite pose of the robot.

    Raises:
        BadInput: If there are any; driven again they would fail again.
    """
    failed = sum(one.fault == "physics failed" for one in driven)
    if failed:
        raise BadInput(f"physics failed in {failed} of {counted(len(driven), 'drive')}: it gave no finite pose of the "
                       "robot; look at the masses, sizes and loads of the robots")
