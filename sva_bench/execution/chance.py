"""What chance decides in one mission, asked for as the mission goes: drawn ahead, or every answer in turn.

A history is one sequence of answers. With few robots that may fail there are few of them, and their probabilities give
expectations without sampling error.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple, Protocol

from sva_bench.execution.outcome import RobotFate
from sva_bench.mission.failures import JointState, PlanningTerms


class Window(NamedTuple):
    """Driving times between which a robot fails [s]; both ends are the same where it is known when."""

    since_s: float
    until_s: float


class Chance(Protocol):
    """What decides about the failures of a team, robot by robot, by the robot's position."""

    def leaves(self, robot: int) -> bool:
        """Whether it can leave the base."""
        ...

    def tries(self, robot: int, number: int) -> bool:
        """Whether it survives leaving for the ``number``-th POI that it tries."""
        ...

    def drives(self, robot: int, since_s: float, until_s: float) -> Window | None:
        """When it fails on a leg that it drives between these driving times; ``None`` = it doesn't."""
        ...

    def failed_by(self, robot: int, window: Window, driven_s: float) -> Window | None:
        """Of a robot that fails within a window, whether it did by then: when; ``None`` = later."""
        ...

    def middle_s(self, robot: int, window: Window) -> float:
        """Mean driving time at which a robot fails that does so within a window [s]."""
        ...


class Drawn:
    """Fates that were drawn ahead."""

    def __init__(self, fates: Sequence[RobotFate]) -> None:
        self._fates = fates

    def leaves(self, robot: int) -> bool:
        """Whether it can leave the base."""
        return self._fates[robot].before_poi > 0

    def tries(self, robot: int, number: int) -> bool:
        """Whether it survives leaving for the ``number``-th POI that it tries."""
        return self._fates[robot].before_poi != number

    def drives(self, robot: int, since_s: float, until_s: float) -> Window | None:
        """When it fails on a leg: it is known exactly."""
        lifetime_s = self._fates[robot].lifetime_s
        return Window(lifetime_s, lifetime_s) if since_s <= lifetime_s < until_s else None

    def failed_by(self, robot: int, window: Window, driven_s: float) -> Window | None:  # noqa: ARG002
        """Whether it failed by then."""
        return window if window.until_s <= driven_s else None

    def middle_s(self, robot: int, window: Window) -> float:  # noqa: ARG002
        """When it fails: windows have no width."""
        return window.since_s


class History:
    """One history: the first answers are given, and then nothing fails.

    Args:
        terms: Probabilities to leave, to survive until the next POI, and failures in a second of driving.
        joint: Joint distribution of availabilities, which decides about whole missions alone; ``None`` = independent.
        answers: The first answers.

    Attributes:
        answers: All answers so far.
        weight: Their probability.
    """

    def __init__(self, terms: PlanningTerms, joint: Sequence[JointState] | None, robots: Sequence[str],
                 answers: Sequence[bool] = ()) -> None:
        self._terms, self._robots, self._given = terms, robots, answers
        self._joint = joint if terms.survival is None and terms.rate is None else None  # else robots fail on their own
        self._known: dict[int, bool] = {}
        self.answers: list[bool] = []
        self.weight = 1.0

    def leaves(self, robot: int) -> bool:
        """Whether it can leave the base: the same whenever it is asked."""
        if robot not in self._known:
            self._known[robot] = self._ask(self._chance_to_leave(robot))
        return self._known[robot]

    def tries(self, robot: int, number: int) -> bool:  # noqa: ARG002
        """Whether it survives leaving for the next POI."""
        return self._terms.survival is None or self._ask(float(self._terms.survival[robot]))

    def drives(self, robot: int, since_s: float, until_s: float) -> Window | None:
        """Whether it fails on a leg, and between which driving times."""
        rate = 0.0 if self._terms.rate is None else float(self._terms.rate[robot])
        if rate == 0:
            return None
        if math.isinf(rate):
            return Window(since_s, since_s)
        return None if self._ask(math.exp(-rate * (until_s - since_s))) else Window(since_s, until_s)

    def failed_by(self, robot: int, window: Window, driven_s: float) -> Window | None:
        """Whether it failed by then; a window of no width is known."""
        assert self._terms.rate is not None, "windows come from rates alone"
        if window.until_s <= driven_s:
            return window
        if driven_s <= window.since_s:
            return None
        rate = float(self._terms.rate[robot])
        by_then = math.expm1(-rate * (driven_s - window.since_s)) \
            / math.expm1(-rate * (window.until_s - window.since_s))
        return None if self._ask(1 - by_then) else Window(window.since_s, driven_s)

    def middle_s(self, robot: int, window: Window) -> float:
        """Mean driving time at which a robot fails that does so within a window [s]."""
        width = window.until_s - window.since_s
        if width <= 0 or self._terms.rate is None:
            return window.since_s
        spent = float(self._terms.rate[robot]) * width
        # The mean of an exponential lifetime that ends within the width.
        share = 0.5 - spent / 12 if spent < 1e-4 else 1 / spent - (1 / math.expm1(spent) if spent < 500 else 0.0)
        return window.since_s + width * share

    def _chance_to_leave(self, robot: int) -> float:
        if self._joint is None:
            return float(self._terms.share[robot])
        possible = [state for state in self._joint if all(
            (self._robots[other] in state.available) == leaves for other, leaves in self._known.items())]
        total = sum(state.probability for state in possible)
        able = sum(state.probability for state in possible if self._robots[robot] in state.available)
        return able / total if total > 0 else 1.0

    def _ask(self, chance: float) -> bool:
        """An answer that is certain is no branch."""
        if chance <= 0 or chance >= 1:
            return chance > 0
        answer = self._given[len(self.answers)] if len(self.answers) < len(self._given) else True
        self.answers.append(answer)
        self.weight *= chance if answer else 1 - chance
        return answer


class Histories:
    """Every history of a team, one after the other, as a tree that is searched in depth.

    Which questions a history asks depends on the answers before them, so a history is played before the next is known.
    """

    def __init__(self, terms: PlanningTerms, joint: Sequence[JointState] | None, robots: Sequence[str]) -> None:
        self._terms, self._joint, self._robots = terms, joint, robots

    def __iter__(self) -> Iterator[History]:
        waiting: list[tuple[bool, ...]] = [()]
        while waiting:
            given = waiting.pop()
            history = History(self._terms, self._joint, self._robots, given)
            yield history
            waiting += [(*history.answers[:k], False) for k in range(len(given), len(history.answers))]
