"""What the execution of a mission meets that its plan doesn't know of: noise, passages that shut, slippery floors."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class LocalisationError:
    """Error of a robot's belief of where it is, the same whenever it is at the same place.

    Attributes:
        sd_m: Standard deviation along either axis [m].
        sd_deg: Standard deviation of the heading [degrees].
        length_m: Distance over which the error changes [m].
    """

    sd_m: float
    sd_deg: float
    length_m: float


@dataclass(frozen=True, kw_only=True)
class People:
    """People in the way, who make robots wait.

    Attributes:
        per_m: How many a robot meets a metre, on average.
        stop_s: How long each makes it wait [s].
    """

    per_m: float
    stop_s: float


@dataclass(frozen=True, kw_only=True)
class Noise:
    """What varies between rollouts, drawn for each rollout and robot.

    Attributes:
        wheel_gain_sd: Standard deviation of each wheel's speed gain about 1.
        speed_gain_sd: Standard deviation of the common speed gain of both wheels about 1.
        track_gain_sd: Standard deviation of the track about what the controller reckons with, as a share.
        localisation: Error of localisation; ``None`` = robots know where they are.
        delay_s: Least and greatest time from a command until the wheels obey [s].
        capacity_sd: Standard deviation of the fuel capacity about the nominal one, as a share.
        capacity_fade: Least and greatest share of the capacity that age has taken.
        payload_kg: Least and greatest payload [kg].
        hull_friction: Friction of hulls against what they scrape along, the same in all rollouts; 0 = they slide.
        people: People in the way; ``None`` = nobody.
    """

    wheel_gain_sd: float = 0.0
    speed_gain_sd: float = 0.0
    track_gain_sd: float = 0.0
    localisation: LocalisationError | None = None
    delay_s: tuple[float, float] = (0.0, 0.0)
    capacity_sd: float = 0.0
    capacity_fade: tuple[float, float] = (0.0, 0.0)
    payload_kg: tuple[float, float] = (0.0, 0.0)
    hull_friction: float = 0.0
    people: People | None = None

    @property
    def silent(self) -> bool:
        """Whether all rollouts are equal."""
        return self == Noise(hull_friction=self.hull_friction)


REALISTIC = Noise(
    wheel_gain_sd=0.0025, speed_gain_sd=0.02, track_gain_sd=0.02,
    localisation=LocalisationError(sd_m=0.05, sd_deg=2.0, length_m=0.5), delay_s=(0.03, 0.12), capacity_sd=0.03,
    hull_friction=0.4)
"""``noise: realistic``. docs/noise.md has the source of each figure. Ageing, payload and people are no part of it: they
are known of a fleet and its place, so whoever has them says so."""


@dataclass(frozen=True, kw_only=True)
class Passage:
    """A door or gate that may be shut.

    Attributes:
        name: Its name.
        ends_m: x, y of one end, and of the other [m].
        blocked: Probability that a robot finds it shut, at each crossing.
        wait_s: How long it then waits [s].
    """

    name: str
    ends_m: tuple[float, float, float, float]
    blocked: float
    wait_s: float
