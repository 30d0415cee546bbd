"""The schema of what the execution of a mission meets: noise, passages, floors."""

from __future__ import annotations

from difflib import get_close_matches
from typing import Annotated, Any, Self, get_args

from pydantic import BeforeValidator, Field, field_validator, model_validator

from sva_bench.choices import NoisePreset
from sva_bench.files.fields import Bounded, Probability, Section
from sva_bench.files.printable import shown
from sva_bench.world.noise import REALISTIC, LocalisationError, Noise, Passage, People

_MOST_DELAY_S = 0.15
_MOST_SLOPE = 0.2  # its gradient has this standard deviation; at five of them, 1, two places would look like one
_Share = Annotated[float, Field(strict=True, ge=0, le=0.2, allow_inf_nan=False)]
_Coordinate = Annotated[float, Field(strict=True, ge=-1e5, le=1e5, allow_inf_nan=False)]
_Point = Annotated[list[_Coordinate], Field(min_length=2, max_length=2, description="a point [x, y]")]
LENGTHS = "two lengths [along x, along y]"
_Size = Annotated[float, Field(strict=True, ge=1e-6, le=1e5, allow_inf_nan=False)]


def _range(low: float, high: float) -> Any:
    limits = Field(strict=True, ge=low, le=high, allow_inf_nan=False)
    return Annotated[list[Annotated[float, limits]], Field(
        min_length=2, max_length=2, description="two numbers [least, most]")]


class LocalisationEntry(Section):
    """The error field of a robot's localisation; it may not change so fast that a place has no place of its own."""

    sd_m: Annotated[float, Field(strict=True, ge=0, le=1, allow_inf_nan=False)]
    sd_deg: Annotated[float, Field(strict=True, ge=0, le=30, allow_inf_nan=False)] = 0.0
    length_m: Annotated[float, Field(strict=True, ge=0.05, le=100, allow_inf_nan=False)]

    @model_validator(mode="after")
    def _changes_slowly(self) -> Self:
        if self.sd_m > _MOST_SLOPE * self.length_m:
            raise ValueError(f"an error of {self.sd_m:g} m that changes over {self.length_m:g} m would fold the map: "
                             f"sd_m may be at most {_MOST_SLOPE:g} of length_m")
        return self


class PeopleEntry(Section):
    """People met on the way."""

    per_m: Annotated[float, Field(strict=True, ge=0, le=10, allow_inf_nan=False)]
    stop_s: Annotated[float, Field(strict=True, ge=0, le=3600, allow_inf_nan=False)]


class NoiseEntry(Section):
    """Noise: each key adds a source; those left out are taken from the preset, if there is one, or are off."""

    preset: NoisePreset | None = None
    wheel_gain_sd: _Share = 0.0
    speed_gain_sd: _Share = 0.0
    track_gain_sd: _Share = 0.0
    localisation: LocalisationEntry | None = None
    delay_s: _range(0, 10) = Field(default_factory=lambda: [0.0, 0.0])  # type: ignore[valid-type]
    capacity_sd: _Share = 0.0
    capacity_fade: _range(0, 0.95) = Field(default_factory=lambda: [0.0, 0.0])  # type: ignore[valid-type]
    payload_kg: _range(0, 1e5) = Field(default_factory=lambda: [0.0, 0.0])  # type: ignore[valid-type]
    hull_friction: Annotated[float, Field(strict=True, ge=0, le=5, allow_inf_nan=False)] = 0.0
    people: PeopleEntry | None = None

    @field_validator("delay_s", "capacity_fade", "payload_kg")
    @classmethod
    def _in_order(cls, pair: list[float]) -> list[float]:
        if pair[0] > pair[1]:
            raise ValueError(f"expected [least, greatest], found {pair}")
        return pair

    @field_validator("delay_s")
    @classmethod
    def _can_be_driven(cls, pair: list[float]) -> list[float]:
        if pair[1] > _MOST_DELAY_S:
            raise ValueError(f"a delay of {pair[1]:g} s makes robots oscillate about their paths; at most "
                             f"{_MOST_DELAY_S:g} s")
        return pair

    def noise(self) -> Noise:
        """The noise that it describes."""
        told: dict[str, Any] = {}
        for key in self.model_fields_set - {"preset"}:
            value = getattr(self, key)
            told[key] = tuple(value) if isinstance(value, list) else value
        if (place := told.get("localisation")) is not None:
            told["localisation"] = LocalisationError(**place.model_dump()) if place.sd_m or place.sd_deg else None
        if (people := told.get("people")) is not None:
            told["people"] = People(**people.model_dump()) if people.per_m and people.stop_s else None
        base = {} if self.preset is None else {key: getattr(REALISTIC, key) for key in type(self).model_fields
                                               if key != "preset"}
        return Noise(**{**base, **told})


def spelled_out(value: object) -> object:
    """The content of ``noise:`` as a mapping: ``realistic`` is a preset alone, and nothing below the heading no noise.

    What is left out of an error of localisation beside the preset is the preset's too.

    Raises:
        ValueError: If it is neither, with what to write.
    """
    if value is None:
        return {}
    if isinstance(value, str) and value in get_args(NoisePreset):
        return {"preset": value}
    if not isinstance(value, dict):
        word = value[0] if isinstance(value, list) and len(value) == 1 else value
        meant = get_close_matches(word[:200], get_args(NoisePreset), n=1) if isinstance(word, str) else []
        hint = f", did you mean {meant[0]!r}?" if meant else ";"
        raise ValueError(f"found {shown(value)}{hint} expected {' or '.join(map(repr, get_args(NoisePreset)))}, or a "
                         "mapping as {capacity_sd: 0.05}; for no noise leave the key out, or write nothing behind it")
    if isinstance(value, dict) and value.get("preset") == "realistic" and isinstance(value.get("localisation"), dict):
        return {**value, "localisation": {**_content(REALISTIC.localisation), **value["localisation"]}}
    return value


NoiseSection = Annotated[NoiseEntry, BeforeValidator(
    spelled_out, json_schema_input_type=NoiseEntry | NoisePreset | None)]


class PassageEntry(Section):
    """A door or gate that may be shut."""

    at_m: Annotated[list[_Point], Field(
        min_length=2, max_length=2, description="two points [[x1, y1], [x2, y2]], the posts of the passage")]
    blocked: Probability
    wait_s: Bounded

    @field_validator("at_m")
    @classmethod
    def _has_a_width(cls, ends: list[list[float]]) -> list[list[float]]:
        if ends[0] == ends[1]:
            raise ValueError("both ends of the passage are the same point")
        return ends

    def passage(self, name: str) -> Passage:
        """The passage that it describes."""
        (ax, ay), (bx, by) = self.at_m
        return Passage(name=name, ends_m=(ax, ay, bx, by), blocked=self.blocked, wait_s=self.wait_s)


class FloorEntry(Section):
    """A patch of floor that grips less, or more."""

    box: _Point
    size_m: Annotated[list[_Size], Field(min_length=2, max_length=2, description=LENGTHS)]
    yaw_deg: Annotated[float, Field(strict=True, ge=-1e6, le=1e6, allow_inf_nan=False)] = 0.0
    friction: Annotated[float, Field(strict=True, ge=0.01, le=5, allow_inf_nan=False)]


def noise_as_dict(noise: Noise) -> dict[str, Any]:
    """The noise as the content of ``noise:``; sources that are off are left out, but for the wheels'."""
    off = Noise()
    told = {key: getattr(noise, key) for key in Noise.__dataclass_fields__}
    return {key: _content(value) for key, value in told.items() if key == "wheel_gain_sd" or value != getattr(off, key)}


def _content(value: object) -> Any:
    if isinstance(value, LocalisationError | People):
        return {key: getattr(value, key) for key in type(value).__dataclass_fields__}
    return list(value) if isinstance(value, tuple) else value
