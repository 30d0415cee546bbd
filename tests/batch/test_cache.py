"""The cache: what is read from disk is data of exactly the expected type, written by this user, or it isn't there."""

from __future__ import annotations

import hashlib
import os
import pickle
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.batch.cache import Cache
from sva_bench.batch.jobs import PlansJob, TravelTimesJob
from sva_bench.errors import BadInput
from sva_bench.execution.outcome import Driven
from sva_bench.files.codec import NotOfType, decoded, encoded
from sva_bench.study.options import Options
from sva_bench.travel.fuel import fuel_costs
from tests.worlds_for_tests import world_of


@dataclass(frozen=True, eq=False, kw_only=True)
class Odd:
    """Something of every kind that results are made of."""

    word: str
    number: float
    count: int
    sure: bool
    kind: Literal["a", "b"]
    maybe: FloatArray | None
    many: tuple[IntArray | None, ...]
    pair: tuple[float, float]
    by_set: Mapping[frozenset[str], tuple[str, ...]]
    free: Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class OddJob:
    """A job whose result is odd."""

    kind: ClassVar[str] = "odd"
    kept: ClassVar[bool] = True
    result: ClassVar[Any] = Odd
    key: str = "ab12"
    what: str = "odd"

    def run(self) -> Odd:
        return ODD

    def fits(self, result: Odd) -> bool:
        return result.count > 0


ODD = Odd(word="a\u00e9\x1b", number=float("inf"), count=3, sure=True, kind="b", maybe=np.array([[1.0, -0.0]]),
          many=(None, np.array([2**60])), pair=(0.1, 1e-300), by_set={frozenset(("x", "y")): ("z",), frozenset(): ()},
          free={"nodes": 3, "list": [1.5, None, "w"], "map": {}})


def alike(one: Any, other: Any) -> bool:
    """Whether two values are the same in type and content, to the bit."""
    if isinstance(one, np.ndarray):
        return (isinstance(other, np.ndarray) and one.dtype == other.dtype and one.shape == other.shape
                and one.tobytes() == other.tobytes())
    if is_dataclass(one):
        return type(one) is type(other) and all(
            alike(getattr(one, field.name), getattr(other, field.name)) for field in fields(one))
    if isinstance(one, Mapping):
        return isinstance(other, Mapping) and list(one) == list(other) and all(alike(one[k], other[k]) for k in one)
    if isinstance(one, tuple | list):
        return type(one) is type(other) and len(one) == len(other) and all(map(alike, one, other))
    return type(one) is type(other) and bool(one == other)


def test_what_is_encoded_is_decoded_to_the_bit() -> None:
    assert alike(decoded(encoded(ODD, Odd), Odd), ODD)


@given(arrays.arrays(np.float64, st.integers(0, 5), elements=st.floats(allow_nan=False)), st.booleans())
def test_drives_are_decoded_to_the_bit(legs: FloatArray, stuck: bool) -> None:
    drive = Driven(leg_s=legs, stuck=stuck, leg_of=legs, clock_s=legs, pose=np.ones((len(legs), 3)))
    assert alike(decoded(encoded(drive, Driven), Driven), drive)


@pytest.mark.parametrize("wrong", [{"count": 1.0}, {"count": True}, {"sure": 1}, {"kind": "c"}, {"word": b"w"},
                                   {"number": float("nan")}, {"pair": (1.0,)}, {"maybe": np.array([1])},
                                   {"free": {"x": object()}}, {"free": {1: 2}}, {"many": [None]}])
def test_a_value_of_another_type_is_not_encoded(wrong: dict[str, Any]) -> None:
    odd = Odd(**{field.name: getattr(ODD, field.name) for field in fields(Odd)} | wrong)
    with pytest.raises(NotOfType):
        encoded(odd, Odd)


@given(st.integers(0), st.binary(max_size=12), st.integers(0, 12))
def test_bytes_that_were_tampered_with_give_the_type_or_are_refused(at: int, put: bytes, cut: int) -> None:
    content = encoded(ODD, Odd)
    at %= len(content)
    try:
        assert isinstance(decoded(content[:at] + put + content[at + cut:], Odd), Odd)
    except NotOfType:
        return


@pytest.mark.parametrize("content", [
    b"", b"\0" * 8, b"\xff" * 8, b"\xff" * 90, encoded(ODD, Odd) + b"\0", (2).to_bytes(8, "little") + b"[]",
    (40_000).to_bytes(8, "little") + b"[" * 40_000, (9000).to_bytes(8, "little") + b"9" * 9000])
def test_what_is_no_value_of_the_type_is_refused(content: bytes) -> None:
    with pytest.raises(NotOfType):
        decoded(content, Odd)


def test_an_array_declared_larger_than_its_file_allocates_nothing() -> None:
    head = b"[[99999999999],false,[0],[0],[0,3],[],[],1.0,0.0,null,false,0.0]"
    with pytest.raises(NotOfType, match="cut off"):
        decoded(len(head).to_bytes(8, "little") + head, Driven)


def test_results_of_a_real_world_come_back_as_they_were_and_fit_their_job(tmp_path: Path) -> None:
    world, cache = world_of(tmp_path), Cache(folder=tmp_path / "cache")
    travel = TravelTimesJob(world=world, model=world.robots[0].model, planner="prmstar")
    times = travel.run()
    cache.put(travel, travel.key, times)
    assert alike(cache.get(travel, travel.key), times)
    plans = PlansJob(world=world, costs={times.model.name: fuel_costs(times, world.margin)}, options=Options())
    planned = plans.run()
    cache.put(plans, plans.key, planned)
    assert alike(cache.get(plans, plans.key), planned)
    # Whole, of the right type, and of another world: not this job's.
    other = TravelTimesJob(world=world, model=world.robots[0].model, planner="rrtconnect")
    stranger = Driven(leg_s=np.ones(1), stuck=False, leg_of=np.empty(0), clock_s=np.empty(0), pose=np.empty((0, 3)))
    body = encoded(stranger, Driven)
    put_file(cache, other.kind, other.key, hashlib.sha256(body).digest() + body)
    assert cache.get(other, other.key) is None


class Trap:
    """Runs code where it is unpickled."""

    def __reduce__(self) -> Any:
        return Path.touch, (Path("sprung"),)


def put_file(cache: Cache, kind: str, key: str, content: bytes) -> Path:
    path = next(path for path in cache.folder.iterdir()) / kind / key[:2] / key
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    path.chmod(0o600)
    return path


@pytest.fixture
def cache(tmp_path: Path) -> Cache:
    kept = Cache(folder=tmp_path / "cache")
    kept.put(OddJob(), "ab12", ODD)
    assert alike(kept.get(OddJob(), "ab12"), ODD)
    return kept


def test_a_planted_file_runs_no_code_and_counts_as_absent(cache: Cache, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(cache.folder)
    body = pickle.dumps(Trap())
    put_file(cache, "odd", "ab12", hashlib.sha256(body).digest() + body)
    assert cache.get(OddJob(), "ab12") is None
    assert not Path("sprung").exists()


@pytest.mark.parametrize(("kept", "more"), [(0, b""), (-1, b""), (40, b""), (None, b"x"),
                                            (0, hashlib.sha256(b"").digest())])
def test_a_torn_an_empty_or_an_altered_file_counts_as_absent(cache: Cache, kept: int | None, more: bytes) -> None:
    (file,) = (path for path in cache.folder.rglob("ab12") if path.is_file())
    file.write_bytes(file.read_bytes()[:kept] + more)
    assert cache.get(OddJob(), "ab12") is None


def test_a_result_that_does_not_fit_its_job_counts_as_absent(cache: Cache) -> None:
    none = Odd(**{field.name: getattr(ODD, field.name) for field in fields(Odd)} | {"count": 0})
    cache.put(OddJob(), "ab12", none)
    assert cache.get(OddJob(), "ab12") is None


def test_a_file_that_others_can_write_to_a_link_and_a_pipe_count_as_absent(cache: Cache, tmp_path: Path) -> None:
    (file,) = (path for path in cache.folder.rglob("ab12") if path.is_file())
    file.chmod(0o622)
    assert cache.get(OddJob(), "ab12") is None
    file.chmod(0o600)
    moved = file.rename(tmp_path / "moved")
    file.symlink_to(moved)
    assert cache.get(OddJob(), "ab12") is None
    file.unlink()
    os.mkfifo(file, 0o600)
    assert cache.get(OddJob(), "ab12") is None


@pytest.mark.parametrize("mode", [0o770, 0o707, 0o777])
def test_a_cache_that_others_can_write_to_is_refused(cache: Cache, mode: int) -> None:
    home = next(cache.folder.iterdir())
    home.chmod(mode)
    with pytest.raises(BadInput, match=f"others can write .* mode {mode:o}"):
        cache.get(OddJob(), "ab12")
    with pytest.raises(BadInput, match="others can write"):
        cache.put(OddJob(), "ab12", ODD)


def test_a_new_cache_is_private_for_any_umask(tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        kept = Cache(folder=tmp_path / "cache")
        kept.put(OddJob(), "ab12", ODD)
    finally:
        os.umask(before)
    modes = {path.name: path.stat().st_mode & 0o777 for path in (kept.folder, *kept.folder.rglob("*"))}
    assert modes["cache"] == modes[next(kept.folder.iterdir()).name] == 0o700
    assert modes["ab12"] == 0o600
    assert alike(kept.get(OddJob(), "ab12"), ODD)
