"""What makes robots wait on their way: passages that are shut, people. A wait takes mission clock and no driving."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.robot.follower import Stretch, arc_lengths
from sva_bench.seeds import Stream, key_of, rng_for
from sva_bench.world.noise import Noise, Passage

PEOPLE = "people"
"""The cause of waits for people; of others it is the passage's name."""


class HopWait(NamedTuple):
    """A wait on the way between two sites.

    Attributes:
        along_m: How far along the path [m].
        lasts_s: How long [s].
        x_m, y_m: Where [m].
        cause: As of ``outcome.Wait``.
    """

    along_m: float
    lasts_s: float
    x_m: float
    y_m: float
    cause: str


def crossings_of(path: FloatArray, passage: Passage) -> list[float]:
    """How far along a path it crosses a passage, each time [m].

    A path that comes to the passage and turns back has not crossed it; one that runs along it crosses where it leaves
    it on the other side. Of two paths that meet in a passage, the one that begins there crosses it.

    Args:
        path: Vertices [m], shape (n, 2).
        passage: The passage.
    """
    ax, ay, bx, by = passage.ends_m
    side = (path - (ax, ay)) @ np.array([ay - by, bx - ax])
    arc = arc_lengths(np.ascontiguousarray(path))
    off = np.flatnonzero(side)  # vertices that are not on its line
    found = []
    for before, after in pairwise([-1, *off.tolist()]):
        if after == 0 or (before >= 0 and (side[before] < 0) == (side[after] < 0)):
            continue
        k = after - 1  # the last vertex before it is over
        share = side[k] / (side[k] - side[after])
        x, y = path[k] + share * (path[after] - path[k])
        across = ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / ((bx - ax) ** 2 + (by - ay) ** 2)
        if 0 <= across <= 1:
            found.append(float(arc[k] + share * (arc[after] - arc[k])))
    return found


def waits_on(
    hop: Sequence[Stretch], ends: tuple[str, str], noise: Noise, passages: Sequence[Passage], seed: int, rollout: int,
    robot: int, back_m: float,
) -> tuple[HopWait, ...]:
    """The waits of a robot between two sites in a rollout, in order.

    What it finds there depends on rollout, robot and the pair of sites alone: so it is the same for every plan, policy
    and fidelity, and a leg that is driven twice in a rollout finds the same.

    Args:
        hop: The stretches of its path.
        ends: Names of the sites.
        noise, passages: As in the world.
        seed: Root seed.
        rollout: Number of the noise draw.
        robot: The robot's position in its team.
        back_m: How far before a passage it stops [m].
    """
    if noise.people is None and not passages:
        return ()
    path = np.concatenate([hop[0].path[:1], *(stretch.path[1:] for stretch in hop)])
    arc = arc_lengths(np.ascontiguousarray(path))
    place = key_of(*ends)
    waits = []
    for passage in passages:
        if not (crossed := crossings_of(path, passage)):
            continue
        shut = rng_for(seed, Stream.PASSAGE, rollout, robot, *place, *key_of(passage.name)).random(len(crossed))
        waits += [_wait(path, arc, max(at - back_m, 0.0), passage.wait_s, passage.name)
                  for at, drawn in zip(crossed, shut.tolist(), strict=True)
                  if drawn < passage.blocked and passage.wait_s > 0]
    if noise.people is not None:
        rng = rng_for(seed, Stream.PEOPLE, rollout, robot, *place)
        met = rng.uniform(0.0, float(arc[-1]), rng.poisson(noise.people.per_m * float(arc[-1])))
        waits += [_wait(path, arc, at, noise.people.stop_s, PEOPLE) for at in met.tolist()]
    return tuple(sorted(waits))


def _wait(path: FloatArray, arc: FloatArray, along_m: float, lasts_s: float, cause: str) -> HopWait:
    x, y = (float(np.interp(along_m, arc, path[:, axis])) for axis in (0, 1))
    return HopWait(along_m, lasts_s, x, y, cause)
