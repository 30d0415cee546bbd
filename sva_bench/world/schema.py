"""The schema of world files."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag, create_model, field_validator, model_validator

from sva_bench.choices import Departures, FailureProcess, Interaction, News, PolicyName
from sva_bench.files.fields import (
    Bounded,
    MeanTime,
    Name,
    NonNegativeInt,
    Number,
    Positive,
    Probability,
    Rate,
    Section,
)
from sva_bench.seeds import MOST_SEED
from sva_bench.world.maps.formats import FORMATS
from sva_bench.world.maps.section import MapSection
from sva_bench.world.noise_schema import LENGTHS, FloorEntry, NoiseEntry, NoiseSection, PassageEntry
from sva_bench.world.places import APART_M
from sva_bench.world.robot_schema import ModelEntry

KIND = "sva-bench/world@1"
Coordinate = Annotated[Number, Field(ge=-1e5, le=1e5)]
Size = Annotated[Positive, Field(ge=1e-6, le=1e5)]  # smaller sizes are lost in physics
Angle = Annotated[Number, Field(ge=-1e6, le=1e6)]
Seed = Annotated[NonNegativeInt, Field(le=MOST_SEED)]
Point = Annotated[list[Coordinate], Field(min_length=2, max_length=2, description="a point [x, y]")]


class Box(Section):
    box: Point
    size_m: Annotated[list[Size], Field(min_length=2, max_length=2, description=LENGTHS)]
    yaw_deg: Angle = 0.0


class Cylinder(Section):
    cylinder: Point
    radius_m: Size


class Wall(Section):
    wall: Annotated[list[Point], Field(
        min_length=2, max_length=2, description="two points [[x1, y1], [x2, y2]] (a wall that bends is several)")]
    thickness_m: Size = 0.1

    @field_validator("wall")
    @classmethod
    def _has_a_length(cls, ends: list[list[float]]) -> list[list[float]]:
        if math.dist(ends[0], ends[1]) < 1e-6:
            raise ValueError("both ends of the wall are the same point")
        return ends


class Shapes(Section):
    bounds_m: Annotated[list[Number], Field(min_length=4, max_length=4, description="[x_min, y_min, x_max, y_max]")]
    obstacles: list[Box | Cylinder | Wall] = Field(default_factory=list)
    floors: Annotated[list[FloorEntry], Field(max_length=1000)] = Field(default_factory=list)

    @field_validator("bounds_m")
    @classmethod
    def _are_not_empty(cls, bounds: list[float]) -> list[float]:
        if not (bounds[0] < bounds[2] and bounds[1] < bounds[3]):
            raise ValueError(f"expected x_min, y_min, x_max, y_max with min below max, found {bounds}")
        if max(bounds[2] - bounds[0], bounds[3] - bounds[1]) > 2000 or max(map(abs, bounds)) > 1e5:
            raise ValueError("a world may be at most 2000 m wide and 100 km from the origin")
        return bounds


KINDS_OF_MAP = ("shapes", *FORMATS)


class _MapWithoutFormats(Section):
    """The map: exactly one of these keys."""

    shapes: Shapes | None = None

    @model_validator(mode="before")
    @classmethod
    def _has_one_kind(cls, data: object) -> object:
        if isinstance(data, dict):
            kinds = [kind for kind in KINDS_OF_MAP if kind in data]
            if len(kinds) != 1 and not set(data) - set(KINDS_OF_MAP):
                found = " and ".join(kinds) or "none"
                expected = f"{', '.join(KINDS_OF_MAP[:-1])} and {KINDS_OF_MAP[-1]}"
                raise ValueError(f"expected exactly one of {expected}, found {found}")
            for kind in kinds:
                if data[kind] is None:
                    raise ValueError(f"there is nothing below {kind!r}; say what the map is")
        return data

    def source(self) -> tuple[str, MapSection] | None:
        """Key and content of the format's section; ``None`` where the map is described by shapes."""
        found = ((key, getattr(self, key)) for key in FORMATS)
        return next(((key, section) for key, section in found if section is not None), None)


if TYPE_CHECKING:
    Map = _MapWithoutFormats
else:  # with a key for each format
    Map = create_model("Map", __base__=_MapWithoutFormats, __doc__=_MapWithoutFormats.__doc__,
                       **{form.key: (form.section | None, None) for form in FORMATS.values()})


_EMPTY_IS_NONE = BeforeValidator(lambda value: {} if value is None else value)  # a heading with nothing below


class SiteEntry(Section):
    at_m: Point
    heading_deg: Angle | None = None
    stop_s: Bounded = 0.0

    @model_validator(mode="before")
    @classmethod
    def _has_no_slots(cls, data: object) -> object:
        if cls is SiteEntry and isinstance(data, dict) and "slots" in data:
            raise ValueError("only stations have 'slots': a base has a berth for each robot, and a POI serves one at a "
                             "time; take them away")
        return data


MOST_SLOTS = 20
Slots = Annotated[int, Field(strict=True, ge=1, le=MOST_SLOTS)]


class StationEntry(SiteEntry):
    charge_rate: Rate | None = None
    slots: Slots = 1


class SpreadStations(Section):
    """Stations placed automatically, as far apart as possible."""

    spread: Annotated[NonNegativeInt, Field(ge=1, le=100)]
    stop_s: Bounded = 0.0
    charge_rate: Rate | None = None
    slots: Slots = 1


class RandomPois(Section):
    """POIs drawn at random from the free region connected with the base."""

    random: Annotated[NonNegativeInt, Field(ge=1, le=1000)]
    seed: Seed
    min_spacing_m: Annotated[Positive, Field(ge=0.01, le=1000)] = APART_M
    stop_s: Bounded = 0.0


def _how_placed(data: object) -> str:
    """The tag of named or automatically placed sites; a named site may be called ``random``, but has a mapping."""
    placed = isinstance(data, dict) and any(
        key in data and not isinstance(data[key], dict) for key in ("random", "spread"))
    return "[placed]" if placed else "[named]"


class Sites(Section):
    base: SiteEntry
    stations: Annotated[
        Annotated[dict[Name, StationEntry], Tag("[named]")] | Annotated[SpreadStations, Tag("[placed]")],
        Discriminator(_how_placed), _EMPTY_IS_NONE] = Field(default_factory=dict)
    pois: Annotated[
        Annotated[dict[Name, SiteEntry], Tag("[named]")] | Annotated[RandomPois, Tag("[placed]")],
        Discriminator(_how_placed)]


class Drawn(Section):
    """Incentives drawn at random for each POI: uniform, with a share of them zero."""

    uniform: Annotated[list[Bounded], Field(min_length=2, max_length=2, description="two numbers [least, most]")]
    zero_share: Probability = 0.0
    seed: Seed

    @field_validator("uniform")
    @classmethod
    def _in_order(cls, uniform: list[float]) -> list[float]:
        if uniform[0] > uniform[1]:
            raise ValueError(f"expected [low, high], found {uniform}")
        return uniform


class RobotEntry(Section):
    model: ModelEntry
    fuel_capacity_s: Bounded | None = None
    mission_limit_s: Bounded | None = None
    availability: Probability | None = None
    mtbf_s: MeanTime | None = None
    loss_cost: Bounded = 0.0
    idle_share: Probability = 0.0
    incentives: dict[Name, Bounded] | Drawn


class JointEntry(Section):
    probability: Probability
    available: list[Name]


class Joint(Section):
    joint: Annotated[list[JointEntry], Field(min_length=1)]


class FailureEntry(Section):
    plan: FailureProcess
    execute: FailureProcess


class ReactionEntry(Section):
    policy: PolicyName = "none"
    news: News | None = None


class WorldFile(Section):
    """A world file."""

    format: Literal["sva-bench/world@1"]
    name: Name
    map: Map
    sites: Sites
    robots: Annotated[dict[Name, RobotEntry], Field(min_length=1)]
    scenarios: Annotated[dict[Name, dict[Name, Probability] | Joint], Field(min_length=1)] | None = None
    failure: FailureProcess | FailureEntry = "mission"
    reaction: Annotated[ReactionEntry, _EMPTY_IS_NONE] = Field(default_factory=ReactionEntry)
    interaction: Interaction = "independent"
    departures: Departures = "together"
    margin: Annotated[float, Field(strict=True, ge=0, le=1, allow_inf_nan=False)] = 0.01
    noise: NoiseSection = Field(default_factory=NoiseEntry)
    passages: Annotated[dict[Name, PassageEntry], Field(max_length=1000), _EMPTY_IS_NONE] = Field(default_factory=dict)
