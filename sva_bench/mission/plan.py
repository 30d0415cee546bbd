"""Plans: the route of each robot, and the claims of the planner."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Real
from typing import Any

from sva_bench.choices import PlanObjective, Status
from sva_bench.files.notebook import notebook_table
from sva_bench.files.printable import counted

Route = tuple[str, ...]
"""Site names from base to base; empty for a robot that stays home."""

_MOST_SHOWN = 60  # stops of a route in a table


@dataclass(frozen=True, eq=False, kw_only=True)
class Plan:
    """Routes, and the claims of their planner.

    Attributes:
        routes: Route of each robot, by its name.
        instance: Name of the instance it was made for.
        objective: The objective it maximises.
        method: The method that made it.
        status: How its solve ended.
        value: Its value under that objective, as claimed.
        bound: Upper bound on that objective.
        fuel_s: Fuel that each robot burns [s of driving].
        runtime_s: Wall-clock time of the solve [s]; the only figure that differs between equal runs.
        seed: Seed of the method.
        details: Other data of the planner.

    Raises:
        ValueError: If a route is none, or a claim is no number.
    """

    routes: Mapping[str, Route]
    instance: str | None = None
    objective: PlanObjective | None = None
    method: str | None = None
    status: Status | None = None
    value: float | None = None
    bound: float | None = None
    fuel_s: Mapping[str, float] = field(default_factory=dict)
    runtime_s: float | None = None
    seed: int | None = None
    details: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not isinstance(self.routes, Mapping):
            raise ValueError(f"routes: expected the route of each robot by its name, found {_kind(self.routes)}")
        object.__setattr__(self, "routes", {robot: _route(robot, stops) for robot, stops in self.routes.items()})
        if not isinstance(self.fuel_s, Mapping):
            raise ValueError(f"fuel_s: expected the fuel of each robot by its name, found {_kind(self.fuel_s)}")
        if not isinstance(self.details, Mapping):
            raise ValueError(f"details: expected data by name, found {_kind(self.details)}")
        claims = {"value": self.value, "bound": self.bound, "runtime_s": self.runtime_s,
                  **{f"fuel_s[{robot!r}]": fuel for robot, fuel in self.fuel_s.items()}}
        for claim, figure in claims.items():
            if isinstance(figure, bool) or not isinstance(figure, Real | None):
                raise ValueError(f"{claim}: expected a number, found {_kind(figure)}")

    def __repr__(self) -> str:
        return f"Plan({self._said()}; {', '.join(f'{name}: {self._stops(name)}' for name in self.routes)})"

    def _repr_html_(self) -> str:
        """A notebook's table: a row for each robot."""
        return notebook_table(self._said(), ("robot", "stops", "fuel [s]", "route"), [
            (name, str(max(len(route) - 2, 0)), f"{self.fuel_s[name]:.1f}" if name in self.fuel_s else "",
             " → ".join(route) if len(route) <= _MOST_SHOWN else " → ".join((*route[:_MOST_SHOWN], "...")))
            for name, route in self.routes.items()])

    def _said(self) -> str:
        """What it is and what was promised, in one line."""
        figures = [f"{what} {figure:.6g}" for what, figure in (("value", self.value), ("bound", self.bound))
                   if figure is not None]
        words = [word for word in (self.objective, self.status, *figures) if word is not None]
        return ", ".join(words) or "no promises"

    def _stops(self, robot: str) -> str:
        return counted(len(self.routes[robot]) - 2, "stop") if len(self.routes[robot]) > 2 else "stays home"

    def route(self, robot: str) -> Route:
        """The robot's route; empty if the plan has none."""
        return self.routes.get(robot, ())

    def drives_like(self, other: Plan) -> bool:
        """Whether every robot has the same route in both plans."""
        return all(self.route(robot) == other.route(robot) for robot in {*self.routes, *other.routes})


def _route(robot: object, stops: object) -> Route:
    """A route as data of any kind.

    Raises:
        ValueError: If it is none.
    """
    if not isinstance(robot, str):
        raise ValueError(f"routes: expected names of robots, found a key of type {_kind(robot)}")
    if isinstance(stops, str | bytes) or not isinstance(stops, Sequence):
        raise ValueError(f"routes[{robot!r}]: expected the names of its sites, such as ('base', 'p1', 'base'), "
                         f"found {_kind(stops)}")
    for number, site in enumerate(stops):
        if not isinstance(site, str):
            raise ValueError(f"routes[{robot!r}][{number}]: expected the name of a site, found {_kind(site)}")
    return tuple(stops)


def _kind(value: object) -> str:
    return "nothing" if value is None else type(value).__name__


def unless_interrupted(plan: Plan) -> Plan:
    """The plan, for callers that need a complete solve.

    Raises:
        KeyboardInterrupt: If Ctrl-C ended its solve early.
    """
    if plan.status == "interrupted":
        raise KeyboardInterrupt
    return plan
