"""The rules of a mission, event by event: a robot departs, drives, runs dry or gets stuck, arrives, stops, comes home.

They are here and nowhere else. ``settle`` plays one robot that keeps its orders; ``team.play`` a team that reacts.
Nothing here knows an engine: what a leg takes is given.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

from sva_bench.choices import End, EventKind
from sva_bench.execution.outcome import Assignment, Driven, Event, Outcome, RobotFate, Wait, met_on_leg
from sva_bench.execution.touch import Touch
from sva_bench.mission.failures import NEVER
from sva_bench.mission.instance import TOLERANCE_S


class LegDriven(NamedTuple):
    """One leg as it was driven.

    Attributes:
        time_s: Driving time [s]; until it gave up, if it got stuck.
        stuck: Whether the robot got stuck on it.
        contacts: How many times the hull came to touch an obstacle.
        waited_s: How long it waited on the way [s]: mission clock, but no driving.
        capacity: Factor on what the robot's tank holds.
        touches, waits: What it touched, and where it waited.
        held_by: What it got stuck by, where that is known.
    """

    time_s: float
    stuck: bool = False
    contacts: int = 0
    waited_s: float = 0.0
    capacity: float = 1.0
    touches: tuple[Touch, ...] = ()
    waits: tuple[Wait, ...] = ()
    held_by: str = ""


_SURE = RobotFate()


class RobotMission:
    """One robot's mission as far as it has been played; it changes by ``depart`` and ``drive`` in turn.

    Attributes:
        orders: Its rules, and the route it began with.
        fate: When it fails.
        start_s: When it sets off on the mission clock [s].
        ahead: Sites that it is to go to yet.
        site: Where it stands, or where it was going when it ended.
        clock_s: Mission clock [s]; at a stop, when the stop is over.
        arrived_s: When it reached its last stop [s].
        driven_s: How long it has driven [s].
        fuel_s: Fuel burnt [s of driving].
        tank_s: Fuel left in the tank [s of driving, of a tank that holds what it should].
        end: How it ended; ``None`` as long as it goes on.
        kept_off: Who stands in its way to a stop that it leaves out, so that it ends ``stuck`` although it comes home.
    """

    def __init__(self, orders: Assignment, fate: RobotFate = _SURE, *, start_s: float = 0.0) -> None:
        self.orders, self.fate = orders, fate
        self.start_s = self.clock_s = self.arrived_s = start_s
        self.driven_s = self.fuel_s = self.waited_s = self.incentive = self._filled_at_s = 0.0
        self.tank_s = orders.fuel_capacity_s
        self.pois = self.stops = self.contacts = 0
        self.end: End | None = None
        self._late = self._lost = False
        self.kept_off = ""
        self._events: list[Event] = []
        self.site = orders.route[0] if orders.route else ""
        self.ahead = orders.route[1:]
        if not self.ahead:
            self.end = "home"  # an empty route ends home, whatever its draw
        elif fate.before_poi == 0:
            self._ends("failed", self.site)
        else:
            self._tell("departed", self.site)

    def leave_at(self, start_s: float) -> None:
        """Set off at another time; only before it has left its base."""
        self.start_s = self.clock_s = self.arrived_s = start_s
        self._events = [replace(event, time_s=start_s) for event in self._events]

    def give(self, stops: tuple[str, ...]) -> None:
        """Replace what is left of its orders; a robot whose mission is over takes none.

        Args:
            stops: Sites from its next decision epoch on, the base last; none for a robot that is to stay at the base.
        """
        if self.end is None:
            self.ahead = stops
            if not stops:
                self._ends("home", self.site)

    @property
    def fails_on_leaving(self) -> bool:
        """Whether it is drawn to fail on leaving its last stop for the next."""
        return self.end is None and self.orders.is_poi(self.ahead[0]) and self.pois + 1 == self.fate.before_poi

    @property
    def burnt_s(self) -> float:
        """Fuel burnt since its tank was filled [s of driving]."""
        return self.fuel_s - self._filled_at_s

    def depart(self) -> str | None:
        """Set off for the next stop, at an epoch: the stop, or ``None`` if the mission is over.

        A robot drawn to fail does so on leaving its last stop for the POI in question.
        """
        if self.end is not None:
            return None
        if self.fails_on_leaving:
            self._ends("failed", self.site, lost=True)
            return None
        return self.ahead[0]

    def lasts(self, leg: LegDriven) -> float:
        """How long it can drive on a leg before it runs dry [s], at most the leg's driving time.

        What it waits on a leg it waits first: where that is decides only about what a leg cut short had of it.
        """
        left_s = max(self.tank_s * leg.capacity - self.orders.idle_share * leg.waited_s, 0.0)
        return min(leg.time_s, left_s) if leg.time_s > left_s + TOLERANCE_S else leg.time_s

    def drive(self, leg: LegDriven) -> None:
        """Drive the leg to the next stop and serve the stop.

        Fuel burns while driving, and at the idle share of that while waiting. A robot whose lifetime ends before it
        would arrive, run dry or get stuck fails there and then.
        """
        to, begun_s = self.ahead[0], self.clock_s
        driven_s = self.lasts(leg)
        self.contacts += leg.contacts
        if not self._idles(leg.waited_s, leg.capacity):
            self._tell_met(leg, begun_s, leg.time_s)
            self._ends("out_of_fuel", to, lost=True)
            return
        self.waited_s += leg.waited_s
        if self.driven_s + driven_s > self.fate.lifetime_s:
            driven_s = self.fate.lifetime_s - self.driven_s
            self._rolls(driven_s, leg.capacity)
            self._tell_met(leg, begun_s, driven_s)
            self.driven_s = self.fate.lifetime_s
            self._ends("failed", to, lost=True)
            return
        self._rolls(driven_s, leg.capacity)
        self._tell_met(leg, begun_s, driven_s)
        if driven_s < leg.time_s:
            self._ends("out_of_fuel", to, lost=True)
        elif leg.stuck:
            self._ends("stuck", to, lost=True, what=leg.held_by)
        else:
            self._arrive(to, leg.capacity)

    def _tell_met(self, leg: LegDriven, begun_s: float, driven_s: float) -> None:
        """Tell of what it met on a leg, until now at the latest."""
        if leg.waits or leg.touches:
            self._events += [replace(event, time_s=min(event.time_s, self.clock_s)) for event in met_on_leg(
                self.ahead[0], begun_s, leg.waits, leg.touches, driven_s)]

    def _rolls(self, time_s: float, capacity: float) -> None:
        """Drive for so long."""
        self.clock_s, self.driven_s = self.clock_s + time_s, self.driven_s + time_s
        self.fuel_s, self.tank_s = self.fuel_s + time_s, self.tank_s - time_s / capacity

    def _idles(self, time_s: float, capacity: float) -> bool:
        """Stand for so long; whether the fuel lasts, else until it is burnt."""
        burnt_s = self.orders.idle_share * time_s
        left_s = max(self.tank_s, 0.0) * capacity
        if lasts := burnt_s <= left_s + TOLERANCE_S:
            self.tank_s -= burnt_s / capacity
        else:
            time_s, burnt_s, self.tank_s = left_s / self.orders.idle_share, left_s, 0.0
        self.clock_s, self.fuel_s = self.clock_s + time_s, self.fuel_s + burnt_s
        return lasts

    def _arrive(self, site: str, capacity: float) -> None:
        """Reach a stop, spend its time, and then refuel, collect, or be home."""
        self.site, self.ahead = site, self.ahead[1:]
        self.stops, self.arrived_s = self.stops + 1, self.clock_s
        self._tell("arrived", site)
        if site in self.orders.stations:
            rate = self.orders.charge_rate.get(site, math.inf)
            self.clock_s += self.orders.stop_s[site] + self.burnt_s / rate
        elif not self.ahead:
            self.clock_s += self.orders.stop_s[site]
        elif not self._idles(self.orders.stop_s[site], capacity):
            self._ends("out_of_fuel", site, lost=True)
            return
        # Only what is over within the mission limit counts; a late robot drives on and earns nothing more.
        if self.clock_s > self.orders.mission_limit_s + TOLERANCE_S and not self._late:
            self._late = True
            self._tell("late", site)
        if site in self.orders.stations:
            self.tank_s, self._filled_at_s = self.orders.fuel_capacity_s, self.fuel_s
            self._tell("refuelled", site)
        elif self.orders.is_poi(site):
            self._collect(site)
        if not self.ahead and self.kept_off and not self._late:
            self._ends("stuck", site, what=self.kept_off)
        elif not self.ahead:
            self._ends("late" if self._late else "home", site)

    def _collect(self, site: str) -> None:
        self.pois += 1
        if not self._late:
            earned = self.orders.incentives.get(site, 0.0)
            self.incentive += earned
            self._tell("collected", site, earned)

    def _tell(self, kind: EventKind, site: str, incentive: float = 0.0) -> None:
        self._events.append(Event(time_s=self.clock_s, kind=kind, site=site, incentive=incentive))

    def _ends(self, end: End, site: str, *, lost: bool = False, what: str = "") -> None:
        self.end, self._lost = end, lost
        self._events.append(Event(time_s=self.clock_s, kind=end, site=site, what=what))

    def outcome(self) -> Outcome:
        """What came of it.

        Raises:
            ValueError: If it is not over.
        """
        if self.end is None:
            raise ValueError(f"the mission of {self.orders.robot} is not over")
        return Outcome(
            available=self.fate.before_poi == NEVER and self.end != "failed", incentive=self.incentive,
            lost=self._lost, value=self.incentive - self.orders.loss_cost if self._lost else self.incentive,
            pois_reached=self.pois, stops_reached=self.stops, end=self.end, end_time_s=self.clock_s,
            fuel_used_s=self.fuel_s, driven_s=self.driven_s,
            waited_s=self.waited_s, contacts=self.contacts, events=tuple(self._events))


def legs_of(driven: Driven) -> list[LegDriven]:
    """The legs of a drive, one after the other."""
    last, held_by = len(driven.leg_s) - 1, driven.held_by
    return [LegDriven(time_s, driven.stuck and leg == last, contacts, waited_s, driven.capacity,
                      driven.touches_on(leg) if contacts else (), driven.waits_on(leg) if driven.waits else (),
                      held_by if leg == last else "")
            for leg, (time_s, contacts, waited_s) in enumerate(zip(
                driven.leg_s.tolist(), driven.contacts.tolist(), driven.waited_s.tolist(), strict=True))]


def settle(orders: Assignment, driven: Driven, fate: RobotFate = _SURE) -> Outcome:
    """What comes of a driven route: one robot, which keeps its orders.

    Args:
        orders: Route and rules.
        driven: Driving time of its legs, at least of those before a failure.
        fate: When it fails.
    """
    mission = RobotMission(orders, fate, start_s=driven.start_s)
    legs = iter(legs_of(driven))
    while mission.depart() is not None:
        mission.drive(next(legs))
    return mission.outcome()
