"""Results of calibrated planning, and what plans are calibrated for."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field, model_validator

from sva_bench.analysis.results import Amount, Share
from sva_bench.choices import Best
from sva_bench.errors import BadInput, closest
from sva_bench.files.complaints import hint_of_per_cent
from sva_bench.files.fields import Probability
from sva_bench.files.records import Record

LEAST_DRAWS = 1000
_DRAWS_FOR_SHARE = 6.0
"""Draws for the share that is asked for, times that share: without a bad one the bound is at 3.7."""
LEAST_SHARE, GREATEST_SHARE = 0.0005, 0.5

Target = float | Best
"""A share of bad missions, or the greatest executed value."""
_Quantile = Annotated[float, Field(strict=True, gt=0, lt=1)]
_Factor = Annotated[float, Field(strict=True, gt=0, le=100)]
_Count = Annotated[int, Field(strict=True, ge=1, le=10_000_000)]


@dataclass(frozen=True, kw_only=True)
class PlanJudged(Record):
    """A plan driven by the twin under noise draws, nobody failing by draw.

    Attributes:
        promised: Its value in the objective and with the costs that it was made for.
        executed: Its mean value over noise draws, and over failures by their probabilities.
        bad: Share of the draws in which some robot runs out of fuel, is late or gets stuck.
    """

    promised: Amount
    executed: Amount
    bad: Share


@dataclass(frozen=True, kw_only=True)
class Tried(PlanJudged):
    """A plan of the curve, on the draws by which plans are chosen.

    Attributes:
        quantile: Quantile of the leg costs that it was made for; ``None`` = the nominal costs.
        factor: Factor on that quantile.
        draws: Noise draws that it was driven under; few where it is clear early that it fails.
    """

    quantile: _Quantile | None
    factor: _Factor
    draws: _Count

    @property
    def nobody_leaves(self) -> bool:
        """Whether it promises nothing, as does a plan in which all stay at the base: it doesn't count."""
        return self.promised <= 0

    @property
    def name(self) -> str:
        """For a person: the costs that it was made for."""
        if self.quantile is None:
            return "nominal"
        return f"{100 * self.quantile:g} %" if self.factor == 1 else f"{100 * self.quantile:g} % x {self.factor:g}"


@dataclass(frozen=True, kw_only=True)
class Calibration(Record):
    """The calibration of a scenario's plan.

    Attributes:
        share: Share of bad missions that was asked for; ``None`` = the greatest executed value was.
        quantile, factor: The costs of the plan chosen, as of ``Tried``.
        promised, executed, bad: The plan on draws that it was not chosen by.
        nominal: The nominal plan on the same draws.
        curve: All that was tried, on the draws by which the plan was chosen.
        reached: Whether the share is proved; always true where none was asked for.
        draws: Noise draws behind ``bad``.
    """

    share: Probability | None
    quantile: _Quantile | None
    factor: _Factor
    bad: Share
    promised: Amount
    executed: Amount
    nominal: PlanJudged
    curve: Annotated[tuple[Tried, ...], Field(min_length=1, max_length=1000)]
    reached: bool
    draws: _Count

    @property
    def chosen(self) -> Tried:
        """The plan chosen, on the draws by which it was."""
        return next(tried for tried in self.curve if (tried.quantile, tried.factor) == (self.quantile, self.factor))

    @property
    def is_nominal(self) -> bool:
        """Whether the nominal plan was chosen."""
        return self.quantile is None

    @model_validator(mode="after")
    def _is_on_its_curve(self) -> Calibration:
        if (self.quantile, self.factor) not in [(tried.quantile, tried.factor) for tried in self.curve]:
            raise ValueError("curve: expected the plan of 'quantile' and 'factor' on it")
        return self


def draws_for(target: Target) -> int:
    """How many draws a plan is judged by."""
    return LEAST_DRAWS if target == "best" else max(LEAST_DRAWS, math.ceil(_DRAWS_FOR_SHARE / target))


def target_of(text: str, what: str = "--calibrate ") -> Target:
    """What plans are calibrated for, such as ``1%`` or ``best``.

    Raises:
        BadInput: If it is neither.
    """
    word = text.strip()
    if word == "best":
        return "best"
    try:
        share = float(word.removesuffix("%")) / 100 if word.endswith("%") else math.nan
    except ValueError:
        share = math.nan
    if not LEAST_SHARE <= share <= GREATEST_SHARE:
        raise BadInput(f"{what}{word[:60]}: expected the share of missions that may go wrong, from "
                       f"{100 * LEAST_SHARE:g}% to {100 * GREATEST_SHARE:g}%, such as 1%, or the word best"
                       + hint_of_per_cent(word)
                       + ("; did you mean 'best'?" if closest(word, ["best"]) else ""))
    return share


def target_text(target: Target) -> str:
    """As ``target_of`` reads it."""
    return target if isinstance(target, str) else f"{100 * target:.12g}%"
