"""Path follower: regulated pure pursuit with rotation in place, compiled.

One control step is a pure function of path, pose and a small state, and the kinematic twin and physics run the same
code. A path is cut into stretches at its sharp corners, by geometry alone, so that
no small pose error decides between stopping at a corner and driving round it. A stretch is driven in three
phases: turn towards the path, drive it, turn into the heading in which it ends.

Source:
    Macenski et al. (2023), "Regulated Pure Pursuit for Robot Path Tracking"; Coulter (1992), "Implementation of the
    Pure Pursuit Path Tracking Algorithm".
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numba import njit

from sva_bench.arrays import FloatArray
from sva_bench.robot.model import LOOKAHEAD_M

CONTROL_HZ = 60.0

TURN_TO_PATH, DRIVE, TURN_TO_HEADING, ARRIVED = 0.0, 1.0, 2.0, 3.0

_LATERAL_M_S2 = 0.5  # lateral acceleration in curves: slows the robot where the path bends
_STEERED = 0.7  # share of the turn acceleration that a curve may need; limits the speed of robots that turn slowly
_CORNER_RAD = 0.6  # at a vertex with a greater bend the robot stops and turns in place
_ASTRAY_RAD = 1.4  # bearing of the lookahead point, beyond any on a path without corners, at which it turns in place
_ALIGNED_RAD = 0.02  # heading error at which a turn in place is over
_REACHED_M = 0.01  # distance to the end of a stretch at which its driving is over
_CREEP_M_S = 0.03  # slowest approach, so that the end is reached in finite time
_SEARCH_M = 0.6  # how far ahead along the path the nearest point is looked for
_BRAKING = 0.9  # share of the acceleration that approach profiles use; the rest absorbs the control delay
_LINE_BRAKING = 0.85  # the same before a stop line, which must not be crossed: what gains and slip take is left over
BEFORE_LINE_M = 0.02
"""From where a robot stops to its stop line [m]."""
NO_LINE = math.inf
"""The stop line of a robot that nothing holds."""


@dataclass(frozen=True, eq=False)
class Stretch:
    """A part of a path without sharp corners.

    Attributes:
        path: Vertices [m], shape (n, 2), n >= 2.
        arc: Arc length at each vertex [m], shape (n,).
        heading_rad: Heading in which the robot stops at its end.
    """

    path: FloatArray
    arc: FloatArray
    heading_rad: float


def stretches(path: FloatArray, heading_rad: float) -> tuple[Stretch, ...]:
    """Cut a path at its sharp corners.

    Args:
        path: Vertices [m], shape (n, 2), n >= 2.
        heading_rad: Heading in which the robot stops at the end of the path.

    Returns:
        The stretches in order; each but the last ends in the direction in which the next begins.
    """
    moves = np.diff(path, axis=0)
    path = path[np.r_[True, np.hypot(moves[:, 0], moves[:, 1]) > 1e-9]]
    if len(path) < 2:
        path = np.repeat(path, 2, axis=0)
    bearings = np.arctan2(*np.diff(path, axis=0).T[::-1])
    bends = np.abs((np.diff(bearings) + np.pi) % (2 * np.pi) - np.pi)
    corners = [0, *(np.flatnonzero(bends > _CORNER_RAD) + 1).tolist(), len(path) - 1]
    cut = []
    for first, last in pairwise(corners):
        part = np.ascontiguousarray(path[first : last + 1])
        cut.append(Stretch(part, arc_lengths(part), heading_rad if last == len(path) - 1 else float(bearings[last])))
    return tuple(cut)


def new_state() -> FloatArray:
    """State at the start of a stretch: phase, arc length travelled [m], commanded speed [m/s] and turn rate [rad/s];
    and whether the stop line held the robot in the last step, 1 or 0."""
    return np.zeros(5)


def horizon_m(limits: FloatArray, dt: float) -> float:
    """Distance along the path beyond which it has no influence on a control step [m].

    Args:
        limits: ``RobotModel.limits``.
        dt: Time between control steps [s].
    """
    # The nearest point is searched up to _SEARCH_M ahead; beyond it, the lookahead point and the braking distance.
    braking = limits[0] ** 2 / (2.0 * _BRAKING * limits[2]) + limits[0] * dt
    return float(_SEARCH_M + max(LOOKAHEAD_M, braking) + _REACHED_M)


@njit(cache=True)  # type: ignore[untyped-decorator]
def arc_lengths(path: FloatArray) -> FloatArray:
    """Arc length at each vertex of a polyline, shape (n,)."""
    arc = np.zeros(len(path))
    for k in range(1, len(path)):
        arc[k] = arc[k - 1] + math.hypot(path[k, 0] - path[k - 1, 0], path[k, 1] - path[k - 1, 1])
    return arc


@njit(cache=True)  # type: ignore[untyped-decorator]
def wrap(angle: float) -> float:
    """The same angle in [-pi, pi)."""
    turned = angle + math.pi
    # Nearly always within already: then the slow remainder is skipped.
    return (turned if 0.0 <= turned < 2.0 * math.pi else turned % (2.0 * math.pi)) - math.pi


@njit(cache=True)  # type: ignore[untyped-decorator]
def _edge_at(arc: FloatArray, s: float) -> int:
    """Index of the edge on which arc length ``s`` lies, by bisection: paths through mazes have thousands of edges."""
    low, high = 0, len(arc) - 2
    while low < high:
        middle = (low + high) // 2
        if arc[middle + 1] <= s:
            low = middle + 1
        else:
            high = middle
    return low


@njit(cache=True)  # type: ignore[untyped-decorator]
def _point_at(path: FloatArray, arc: FloatArray, s: float, k: int) -> tuple[float, float]:
    """The point at arc length ``s``, on edge ``k`` or not far beyond."""
    while k < len(arc) - 2 and arc[k + 1] <= s:
        k += 1
    length = arc[k + 1] - arc[k]
    share = 0.0 if length <= 0.0 else min(max((s - arc[k]) / length, 0.0), 1.0)
    return (path[k, 0] + share * (path[k + 1, 0] - path[k, 0]), path[k, 1] + share * (path[k + 1, 1] - path[k, 1]))


@njit(cache=True)  # type: ignore[untyped-decorator]
def _nearest_arc(path: FloatArray, arc: FloatArray, s: float, x: float, y: float) -> tuple[float, int]:
    """Arc length of the path point nearest to (x, y), between ``s`` and ``_SEARCH_M`` ahead; and its edge."""
    k = _edge_at(arc, s)
    best_x, best_y, best, best_s, best_k = 0.0, 0.0, np.inf, s, k  # ``best`` is squared
    while k < len(path) - 1 and arc[k] <= s + _SEARCH_M:
        dx, dy = path[k + 1, 0] - path[k, 0], path[k + 1, 1] - path[k, 1]
        length = arc[k + 1] - arc[k]
        if length > 0.0:
            share = ((x - path[k, 0]) * dx + (y - path[k, 1]) * dy) / (length * length)
            here = min(max(arc[k] + share * length, max(arc[k], s)), min(arc[k + 1], s + _SEARCH_M))
            share = (here - arc[k]) / length
            aside_x, aside_y = path[k, 0] + share * dx - x, path[k, 1] + share * dy - y
            squared = aside_x * aside_x + aside_y * aside_y
            # Nearer by 1e-12 m or more; square roots, which are slow, are taken only where squares can't decide it.
            nearer = best == np.inf or best - squared > 2e-12 * (1.0 + best)
            if not nearer and squared <= best * (1 + 1e-9):
                nearer = math.hypot(aside_x, aside_y) < math.hypot(best_x, best_y) - 1e-12
            if nearer:
                best_x, best_y, best, best_s, best_k = aside_x, aside_y, squared, here, k
        k += 1
    return best_s, best_k


@njit(cache=True)  # type: ignore[untyped-decorator]
def _rate_limited(now: float, wanted: float, step: float) -> float:
    """The wanted value, at most a step away from the present one."""
    return min(max(wanted, now - step), now + step)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _turn(error: float, rate: float, dt: float, limits: FloatArray) -> float:
    """Turn rate that brings a heading error to zero under the acceleration limit."""
    # The braking curve is evaluated where the robot will be when the command has acted for half a step.
    left = max(abs(error) - 0.5 * abs(rate) * dt, 0.0)
    wanted = min(limits[1], math.sqrt(2.0 * _BRAKING * limits[3] * left), abs(error) / dt)
    return float(_rate_limited(rate, math.copysign(wanted, error), limits[3] * dt))


@njit(cache=True)  # type: ignore[untyped-decorator]
def _before_line(left: float, limits: FloatArray) -> float:
    """Speed from which a robot stops before its stop line, which is ``left`` ahead; then it stands."""
    if left > _SEARCH_M + LOOKAHEAD_M:  # farther than any robot brakes
        return math.inf
    return math.sqrt(2.0 * _LINE_BRAKING * limits[2] * max(left - BEFORE_LINE_M, 0.0))


@njit(cache=True)  # type: ignore[untyped-decorator]
def control(
    path: FloatArray, arc: FloatArray, heading: float, limits: FloatArray, state: FloatArray,
    x: float, y: float, yaw: float, dt: float, stop: float,
) -> tuple[float, float]:
    """One control step along one stretch; compiled, so in one piece.

    On its way along the path the robot is never faster than lets it stop before the stop line; before it, it stands.

    Args:
        path: Vertices of the stretch [m], shape (n, 2).
        arc: Arc length at each vertex, as ``arc_lengths`` gives it.
        heading: Heading at the end of the stretch [rad].
        limits: ``RobotModel.limits``.
        state: As ``new_state`` gives it; changed in place. ``state[0]`` is ``ARRIVED`` at the end.
        x, y, yaw: Pose [m, rad].
        dt: Time until the next control step [s].
        stop: Arc length of the stop line [m], less the way for which commands are under way; ``NO_LINE`` = none.
            ``state[4]`` tells whether it made the command slower than it would be without.

    Returns:
        Speed [m/s] and turn rate [rad/s] to command until the next step.
    """
    phase, s, speed, rate, held = state[0], state[1], state[2], state[3], 0.0
    end = arc[-1]
    if phase == TURN_TO_PATH and end < _REACHED_M:
        phase = TURN_TO_HEADING
    if phase in (TURN_TO_PATH, DRIVE):
        s, edge = _nearest_arc(path, arc, s, x, y)
        ahead_x, ahead_y = _point_at(path, arc, min(s + LOOKAHEAD_M, end), edge)
        aside = wrap(math.atan2(ahead_y - y, ahead_x - x) - yaw)
        left = end - s
        if left < _REACHED_M:
            phase = TURN_TO_HEADING
        elif phase == TURN_TO_PATH and abs(aside) < _ALIGNED_RAD:
            phase = DRIVE
        elif phase == DRIVE and abs(aside) > _ASTRAY_RAD and left > LOOKAHEAD_M / 2:
            phase = TURN_TO_PATH
    if phase == TURN_TO_PATH:
        speed = _rate_limited(speed, 0.0, limits[2] * dt)
        rate = _turn(aside, rate, dt, limits)
    elif phase == DRIVE:
        distance = max(math.hypot(ahead_x - x, ahead_y - y), 0.05)
        curvature = 2.0 * math.sin(aside) / distance
        bend = max(abs(curvature), 1e-9)
        remaining = max(left - 0.5 * speed * dt, 0.0)
        # Over the lookahead distance the robot must reach the curve's turn rate from none.
        lateral = min(_LATERAL_M_S2, _STEERED * limits[3] * LOOKAHEAD_M)
        wanted = min(limits[0], math.sqrt(2.0 * _BRAKING * limits[2] * remaining), math.sqrt(lateral / bend),
                     limits[1] / bend)
        wanted = min(max(wanted, min(_CREEP_M_S, limits[0])), left / dt)
        free = _rate_limited(speed, wanted, limits[2] * dt)
        speed = _rate_limited(speed, min(wanted, _before_line(stop - s, limits)), limits[2] * dt)
        held = 1.0 if speed < free else 0.0
        rate = _rate_limited(rate, speed * curvature, 2.0 * limits[3] * dt)
    if phase == TURN_TO_HEADING:
        error = wrap(heading - yaw)
        speed = _rate_limited(speed, 0.0, limits[2] * dt)
        if abs(error) < _ALIGNED_RAD and abs(speed) < 1e-9:
            phase, rate = ARRIVED, 0.0
        else:
            rate = _turn(error, rate, dt, limits)
    state[0], state[1], state[2], state[3], state[4] = phase, s, speed, rate, held
    return speed, rate


@njit(cache=True)  # type: ignore[untyped-decorator]
def braked(limits: FloatArray, state: FloatArray, dt: float) -> None:
    """One control step of a robot that was turning in place and brakes; it counts as held."""
    state[2] = _rate_limited(state[2], 0.0, limits[2] * dt)
    state[3] = _rate_limited(state[3], 0.0, limits[3] * dt)
    state[4] = 1.0
