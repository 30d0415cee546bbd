"""What robots of one world did to each other, mission by mission."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sva_bench.arrays import BoolArray, FloatArray, IntArray, frozen, frozen_int


@dataclass(frozen=True, eq=False, kw_only=True)
class Meetings:
    """What robots that meet did to each other in some missions. Arrays have shape (missions,).

    Attributes:
        contacts: How many times two robots came to touch each other.
        waited_s: How long robots waited for others, added up over the team [s].
        detours: How many legs were driven on another path than the shortest, because of other robots.
        exact: Whether the mission was played itself, or one that provably ends as it does; else its end was taken over
            from a mission alike.
    """

    contacts: IntArray
    waited_s: FloatArray
    detours: IntArray
    exact: BoolArray

    def __post_init__(self) -> None:
        missions = (len(self.contacts),)
        exact = np.array(self.exact, dtype=np.bool_)
        if exact.shape != missions:
            raise ValueError(f"expected an array of shape {missions}, got {exact.shape}")
        exact.setflags(write=False)
        object.__setattr__(self, "contacts", frozen_int(self.contacts, missions))
        object.__setattr__(self, "waited_s", frozen(self.waited_s, missions))
        object.__setattr__(self, "detours", frozen_int(self.detours, missions))
        object.__setattr__(self, "exact", exact)
        if min((array.min(initial=0) for array in (self.contacts, self.waited_s, self.detours)), default=0) < 0:
            raise ValueError("a negative entry in an array")

    def rows(self, chosen: IntArray | slice) -> Meetings:
        """Those of some missions."""
        return Meetings(contacts=self.contacts[chosen], waited_s=self.waited_s[chosen], detours=self.detours[chosen],
                        exact=self.exact[chosen])


def combined_meetings(parts: Sequence[Meetings | None], chosen: IntArray) -> Meetings | None:
    """Of several cases with the same missions, those of the chosen one, mission by mission.

    Args:
        parts: Those of each case; ``None`` where robots do not meet.
        chosen: Number of the case for each mission, shape (missions,).
    """
    known = [part for part in parts if part is not None]
    if len(known) < len(parts):
        return None
    rows = np.arange(len(chosen))
    return Meetings(contacts=np.stack([part.contacts for part in known])[chosen, rows],
                    waited_s=np.stack([part.waited_s for part in known])[chosen, rows],
                    detours=np.stack([part.detours for part in known])[chosen, rows],
                    exact=np.stack([part.exact for part in known])[chosen, rows])
