"""One stream of random numbers per purpose and item, independent of the order of drawing."""

from __future__ import annotations

import hashlib
from enum import IntEnum

import numpy as np

from sva_bench.arrays import FloatArray

MOST_SEED = 2**63 - 1
"""Seeds have a column of 64 bits in every table."""


class Stream(IntEnum):
    """What a stream is for. Append only: a number keeps its meaning for good, and none is given twice."""

    FAILURE = 0
    NOISE = 1
    INCENTIVE = 2
    JOINT_FAILURE = 4
    RANDOM_WORLD = 7
    PROPOSED_MISSION = 8
    DRAWN_PLACES = 9
    SPEED_GAIN = 10
    TRACK_GAIN = 11
    LOCALISATION = 12
    DELAY = 13
    PAYLOAD = 14
    CAPACITY = 15
    PASSAGE = 16
    PEOPLE = 17
    CHECKED_DRIVE = 18
    CALIBRATION = 19


def seed_for(root: int, stream: Stream, *index: int) -> np.random.SeedSequence:
    """The seed of one stream: the same whatever else was drawn before."""
    return np.random.SeedSequence(root, spawn_key=(stream, *index))


def rng_for(root: int, stream: Stream, *index: int) -> np.random.Generator:
    """A generator for one purpose and item."""
    return np.random.default_rng(seed_for(root, stream, *index))


def key_of(*parts: str | bytes) -> tuple[int, ...]:
    """Index of a stream for one thing, by what it consists of: what differs in anything has a stream of its own."""
    digest = hashlib.sha256()
    for part in parts:
        content = part.encode() if isinstance(part, str) else part
        digest.update(len(content).to_bytes(8, "big") + content)  # "ab", "c" is not "a", "bc"
    words = np.frombuffer(digest.digest()[:16], dtype=">u4")
    return tuple(int(word) for word in words)


def uniforms(root: int, stream: Stream, *index: int, first: int = 0, count: int) -> FloatArray:
    """Numbers ``first`` .. ``first + count - 1`` of a stream of uniforms on [0, 1).

    Philox counts, so trial 17 can be drawn alone, and more trials never change earlier ones.
    """
    bits = np.random.Philox(seed_for(root, stream, *index))
    # One Philox block is four 64-bit words; a double takes one word.
    block, offset = divmod(first, 4)
    bits.advance(block)
    return np.random.Generator(bits).random(offset + count)[offset:]
