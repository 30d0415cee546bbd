"""Worlds read from files."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

from sva_bench.choices import Departures, FailureProcess, Interaction
from sva_bench.study.public.arguments import PathLike, called_from_python, chosen, optional, path_of, world_given
from sva_bench.world.model import World


@called_from_python()
def load_world(
    path: PathLike, *, scenario: str | Sequence[str] | None = None, margin: float | None = None,
    plan_failure: FailureProcess | None = None, execute_failure: FailureProcess | None = None,
    interaction: Interaction | None = None, departures: Departures | None = None,
) -> World:
    """Read a world file (YAML), and resolve what it leaves to us: headings, random sites and incentives.

    Args:
        path: The file.
        scenario: Keep only this scenario, or these.
        margin: Planning costs are twin times x (1 + margin), 0 to 1; by default the file's.
        plan_failure, execute_failure: Failure process that plans are made for, and that is executed; by default the
            file's.
        interaction: What robots are to each other, ``independent``, ``uncoordinated`` or ``shared``; by default the
            file's.
        departures: When robots that share it leave, ``together`` or ``staggered``; by default as the file says.

    Raises:
        BadFile: With file, line, key and what to change.
        BadInput: If the world has no such scenario, or the failure process doesn't go with it.
        ValueError: If an argument is of a wrong type.
    """
    processes = [cast("FailureProcess | None", optional(chosen(FailureProcess), name, value)) for name, value in
                 (("plan_failure", plan_failure), ("execute_failure", execute_failure))]
    return world_given(path_of("path", path), scenario, margin, processes[0], processes[1], interaction,
                       departures)[0]
