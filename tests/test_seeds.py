from __future__ import annotations

import hashlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from sva_bench.seeds import Stream, key_of, rng_for, seed_for, uniforms

roots = st.integers(0, 2**64)
counts = st.integers(0, 40)


@given(roots, st.integers(0, 30), counts)
def test_a_part_of_a_stream_is_the_same_drawn_alone(root: int, first: int, count: int) -> None:
    # Blocks of Philox hold four words: ``first`` runs over all offsets into one.
    whole = uniforms(root, Stream.FAILURE, 2, 5, count=80)
    assert_array_equal(uniforms(root, Stream.FAILURE, 2, 5, first=first, count=count), whole[first : first + count])


@given(roots, counts, counts)
def test_more_numbers_leave_the_earlier_ones_as_they_are(root: int, few: int, more: int) -> None:
    assert_array_equal(uniforms(root, Stream.NOISE, count=few),
                       uniforms(root, Stream.NOISE, count=few + more)[:few])


def test_streams_differ_by_root_purpose_and_item() -> None:
    keys = [(0, Stream.FAILURE, (0, 1)), (0, Stream.FAILURE, (1, 0)), (0, Stream.FAILURE, (0,)),
            (0, Stream.FAILURE, ()), (0, Stream.NOISE, (0, 1)), (1, Stream.FAILURE, (0, 1))]
    first = {float(uniforms(root, stream, *index, count=1)[0]) for root, stream, index in keys}
    assert len(first) == len(keys)


def test_a_generator_depends_on_nothing_drawn_before_it() -> None:
    alone = rng_for(7, Stream.NOISE, 3, 1).standard_normal(4)
    for item in range(5):
        rng_for(7, Stream.NOISE, item, 0).standard_normal(100)
    assert_array_equal(rng_for(7, Stream.NOISE, 3, 1).standard_normal(4), alone)
    assert seed_for(7, Stream.NOISE, 3, 1).spawn_key == (1, 3, 1)


def test_numbers_are_uniform_from_0_up_to_but_not_1() -> None:
    drawn = uniforms(0, Stream.FAILURE, 0, 1, count=40_000)
    assert drawn.min() >= 0
    assert drawn.max() < 1
    # Four standard deviations of a mean of uniforms: 4 sqrt(1 / 12 / 40000) = 0.0058.
    assert drawn.mean() == pytest.approx(0.5, abs=0.0058)
    assert np.corrcoef(drawn[:-1], drawn[1:])[0, 1] == pytest.approx(0, abs=0.02)  # 4 / sqrt(40000)


def test_each_purpose_keeps_its_number() -> None:
    # Append only: a changed number would change every published result.
    assert {stream.name: int(stream) for stream in Stream}.items() >= {
        "FAILURE": 0, "NOISE": 1, "INCENTIVE": 2, "JOINT_FAILURE": 4}.items()


def test_a_negative_root_is_refused() -> None:
    with pytest.raises(ValueError, match="non-negative"):
        uniforms(-1, Stream.FAILURE, count=1)


def test_a_key_by_content_is_the_same_everywhere_and_another_for_other_content() -> None:
    # The first four words of SHA-256 over each part's length in eight bytes and the part itself.
    content = b"".join(len(part).to_bytes(8, "big") + part for part in (b"rooms", b"18.0"))
    digest = hashlib.sha256(content).hexdigest()
    assert key_of("rooms", b"18.0") == tuple(int(digest[k:k + 8], 16) for k in (0, 8, 16, 24))
    keys = [key_of(), key_of(""), key_of("ab", "c"), key_of("a", "bc"), key_of("abc"), key_of("abc", "")]
    assert len(set(keys)) == len(keys)
