"""Types of values in files, and the base class of sections."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

from sva_bench.files.complaints import Loc as Loc
from sva_bench.seeds import MOST_SEED

NAME = r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$"
"""Pattern of names of worlds, sites, robots and scenarios."""
Name = Annotated[str, StringConstraints(pattern=NAME)]
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0)]
Bounded = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=1e9)]
"""Times [s] and incentives: beyond 1e9 the feasibility tolerance is below the rounding of sums."""
Rate = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=1e-6, le=1e9)]
"""Seconds of driving gained per second at a station; a time to charge is thus at most 1e6 times the driving."""
MeanTime = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0)]
"""A mean time to failure [s]; of robots that hardly ever fail it may be any number."""
Probability = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=1)]
NonNegativeInt = Annotated[int, Field(strict=True, ge=0)]
Seed = Annotated[int, Field(strict=True, ge=0, le=MOST_SEED)]


class Section(BaseModel):
    """A part of a document: frozen, and an unknown key is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True)
