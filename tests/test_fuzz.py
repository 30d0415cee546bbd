"""Whatever stands in a file, reading it succeeds or ends in one complaint that names the file.

Good worlds, instances and plans are spoilt at random, as data and as text. Examples shrink: an edit is a few small
numbers, and no edit at all is the good file.
"""

from __future__ import annotations

import io
import json
import math
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from copy import deepcopy
from datetime import timedelta
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML

from sva_bench.__main__ import run_command_line
from sva_bench.errors import SvaBenchError
from sva_bench.mission.certify import certify
from sva_bench.mission.instance import Instance
from sva_bench.mission.instance_file import instance_as_dict, instance_text, read_instance
from sva_bench.mission.plan_file import plan_as_dict, read_plan
from sva_bench.solver.two_stage import SolveLimits, plan_stochastic
from sva_bench.world.load import load_world, world_as_dict
from tests.worlds_for_tests import SMALL

LONGEST = 700
"""Characters of a complaint, its path apart: what still reads on a terminal."""

TINY: dict[str, Any] = {
    "format": "sva-bench/instance@1", "name": "tiny", "sites": ["base", "r1", "p1", "p2"], "base": "base",
    "stations": ["r1"], "fuel_s": [[0, 5, 4, 7], [5, 0, 3, 3], [4, 3, 0, 6], [7, 3, 6, 0]], "stop_s": [0, 0, 0, 0],
    "vehicles": [
        {"name": "uv1", "fuel_capacity_s": 12, "mission_limit_s": 30, "availability": 1.0,
         "incentives": {"p1": 10, "p2": 4}},
        {"name": "uv2", "fuel_capacity_s": 14, "mission_limit_s": None, "availability": 0.75,
         "incentives": {"p1": 5.5, "p2": 8}}],
    "failure": "mission"}
OWN_FUEL: dict[str, Any] = {
    **TINY, "stop_s": [0, 2, 1, 0], "fuel_s": None,
    "vehicles": [vehicle | {"fuel_s": [[0, 4, 4, None], [5, 0, 3, 2], [4, 3, 0, 6], [7.5, 3, 6, 0]]}
                 for vehicle in TINY["vehicles"]]}
JOINT: dict[str, Any] = {
    **TINY, "vehicles": [{k: v for k, v in vehicle.items() if k != "availability"} for vehicle in TINY["vehicles"]],
    "joint_availability": [{"probability": 0.6, "available": ["uv1", "uv2"]},
                           {"probability": 0.4, "available": ["uv1"]}]}
INSTANCES = [TINY, OWN_FUEL, JOINT, {**TINY, "failure": "per_leg"}]
PLANS: list[dict[str, Any]] = [
    {"format": "sva-bench/plan@1", "instance": "tiny", "routes": {"uv1": ["base", "p1", "r1", "p2", "base"]},
     "objective": "stochastic", "method": "expected", "status": "optimal", "value": 14.0, "bound": 14.0,
     "fuel_s": {"uv1": 17.0}, "runtime_s": 0.01, "seed": 0, "details": {"nodes": 3}},
    {"format": "sva-bench/plan@1", "routes": {"uv1": ["base", "p1", "base"], "uv2": []}, "objective": "deterministic"}]

MEMBERS = """\
scenarios:
  S5: {joint: [{probability: 0.6, available: [uv1, uv2]}, {probability: 0.4, available: [uv1]}]}
failure: {plan: mission, execute: per_leg}
reaction: {policy: resolve, news: report}
"""
OTHER_KEYS = SMALL.replace("scenarios:\n  half: {uv2: 0.5}\n  safe: {uv2: 1.0}\n", MEMBERS).replace(
    "incentives: {p1: 10, p2: 20, p3: 30, p4: 40}", "incentives: {uniform: [0, 170], zero_share: 0.5, seed: 3}"
).replace("    model: turtlebot2\n    fuel_capacity_s: 60\n    mission_limit_s: 120\n    avail", """\
    model: {radius_m: 0.2, wheel_radius_m: 0.05, track_m: 0.3, mass_kg: 5, max_speed_m_s: 0.5, max_turn_rad_s: 2,
            acceleration_m_s2: 1, turn_acceleration_rad_s2: 3}
    fuel_capacity_s: 60
    avail""")
WORLDS = [SMALL, OTHER_KEYS] * 4 + [*(path.read_text(encoding="utf-8") for path in sorted(
    (Path(__file__).parents[1] / "worlds").glob("*.yaml")))]  # the small ones are quick

ODD: list[Any] = [
    None, True, False, 0, -1, 1, 2, 0.5, 1e-300, 1e9, 1e308, -1e308, 5e-324, 10**25, -(10**25), 10**400, math.nan,
    math.inf, -math.inf, "", " ", "0", ".nan", ".inf", "1e999", "null", "true", "12:30", "2024-01-01", "base", "p1",
    "r1", "uv1", "mission", "shared", "joint", "[key]", "dict[str,float]", "x" * 64, "x" * 5000, "né", "\u2028",
    "a\nb", "a\rb", "\x1b[31m", "\x00", "\U0001f600", "\ud800", "{0}", "{min_length}", "[bold]", "../x", "*a", "&a",
    "!!python/object",
    [], {}, [[]], [[[[[[]]]]]], [1, 2], [0, 0], [1e308, -1e308], [None, None], ["p1", "p1"], {"": 0}, {"x": {}},
    {"p1": 1}, {"uniform": [0, 1], "seed": 1}, {"joint": []}, {"box": [1, 1], "size_m": [1e-9, 1e308]},
    {"wall": [[-1e308, 0], [1e308, 0]]}, {"wall": [[1e-320, 0], [0, 0]]}, {"cylinder": [1e308, 0], "radius_m": 1e308}]
NUMBERS = [x for x in ODD if x is None or (isinstance(x, int | float) and not isinstance(x, bool))]
JUNK = [
    "\t", "\n", "\r", " ", "  ", ":", ": ", "-", "- ", "?", "? ", "{", "}", "[", "]", ",", '"', "'", "#", "|", ">",
    "@", "`", "&a ", "*a", "<<: ", "!!int ", "!!float ", "!!bool ", "!!null ", "!!binary ", "!!set ", "!!omap ",
    "!x ", "! ", "!!timestamp ", "---\n", "...\n", "%YAML 1.1\n", "%YAML 9.9\n", "%TAG ! x\n", "%", "\\", "\\u",
    "\\ud800", "\x00", "\x07", "\x7f", "\x85", "\ufeff", "\u2028", "\ud800", "é", "\U0001f600", "1e999", "-.inf",
    ".NaN", "NaN", "Infinity", "0x", "0o9", "0b1", "1_0", "9" * 5000, "[" * 40, "[" * 3000, "{a: " * 40, "- " * 2000,
    '{"a":' * 3000, "x" * 3000, "yes", "~", "null", "true"]

Edits = list[tuple[int, int, int]]
edits: st.SearchStrategy[Edits] = st.lists(
    st.tuples(st.integers(0, 7), st.integers(0, 5000), st.integers(0, 5000)), max_size=4)
choices = st.integers(0, 1000)


def places(data: Any) -> list[tuple[Any, Any]]:
    """Every (container, key) of nested data."""
    found: list[tuple[Any, Any]] = []
    for key in list(data) if isinstance(data, dict) else range(len(data)) if isinstance(data, list) else ():
        found.append((data, key))
        found += places(data[key])
    return found


def spoilt(data: Any, spoil: Edits, odd: list[Any]) -> Any:
    """A copy of nested data, edited here and there."""
    data = deepcopy(data)
    for kind, where, what in spoil:
        at = places(data)
        if not at:
            return data
        container, key = at[where % len(at)]
        value = deepcopy(odd[what % len(odd)])
        if kind == 7:
            del container[key]
        elif kind == 6 and isinstance(container, dict):
            container[str(value)] = container.pop(key)
        elif kind == 5:
            other, its = at[what % len(at)]
            container[key] = deepcopy(other[its])
        elif kind == 4 and isinstance(container, list):
            container.insert(key, deepcopy(container[key]))
        elif kind == 4:
            container[f"{key}2"] = deepcopy(container[key])
        elif kind == 3 and isinstance(container[key], dict):
            container[key][str(value)] = value
        elif kind == 3 and isinstance(container[key], list):
            container[key].append(value)
        else:
            container[key] = value
    return data


def as_bytes(text: str) -> bytes:
    return text.encode("utf-8", "surrogatepass")


def as_json(data: Any) -> bytes:
    return as_bytes(json.dumps(data, indent=1, ensure_ascii=False))


def as_yaml(data: Any) -> bytes:
    yaml, text = YAML(typ="safe", pure=True), io.StringIO()
    yaml.allow_unicode = False
    yaml.dump(data, text)
    return as_bytes(text.getvalue())


def garbled(content: bytes, spoil: Edits) -> bytes:
    """A text, edited without regard for what it says."""
    for kind, where, what in spoil:
        at = where % (len(content) + 1)
        if kind == 7:
            content = content[:at]
        elif kind == 6:
            content = content[:at] + bytes([what % 256]) + content[at + 1:]
        elif kind == 5:
            content = content[:at] + content[at + what % 50:]
        elif kind == 4:
            lines = content.split(b"\n")
            lines.insert(where % len(lines), lines[what % len(lines)])
            content = b"\n".join(lines)
        elif kind == 3:  # in place of a value
            end = next((k for k in range(at, len(content)) if content[k] in b",]}\n"), len(content))
            content = content[:at] + as_bytes(JUNK[what % len(JUNK)]) + content[end:]
        else:
            content = content[:at] + as_bytes(JUNK[what % len(JUNK)]) + content[at:]
    return content


@contextmanager
def complaints_about(*paths: Path) -> Iterator[list[SvaBenchError]]:
    """Warnings are errors here; a complaint is caught if it is one line that names one of the files."""
    caught: list[SvaBenchError] = []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            yield caught
        except SvaBenchError as error:
            caught.append(error)
    for complaint in caught:
        path = next((str(path) for path in paths if str(path) in str(complaint)), None)
        assert path is not None, f"names no file: {complaint!s}"
        one_line(str(complaint).replace(path, ""))



def one_line(text: str) -> None:
    """Complain of a message that isn't a single printable line of some length."""
    assert len(text) <= LONGEST, f"{len(text)} characters: {text[:200]}"
    assert text == "".join(text.splitlines()), f"several lines: {text!r}"
    assert all(c.isprintable() for c in text), f"not printable: {text!r}"


def check_world(folder: Path, content: bytes) -> None:
    path, again = folder / "world.yaml", folder / "again.yaml"
    path.write_bytes(content)
    with complaints_about(path) as complaints:
        world = load_world(path)
    if complaints:
        return
    halves = world.obstacles.boxes[:, 2:4]
    assert np.isfinite(world.obstacles.boxes).all()
    assert (halves > 0).all()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        dumped = json.dumps(world_as_dict(world), allow_nan=False)  # finite
        again.write_text(dumped, encoding="utf-8")
        assert json.dumps(world_as_dict(load_world(again)), allow_nan=False) == dumped
    for scenario in world.scenarios:
        assert set(scenario.availability) == {robot.name for robot in world.robots}
        assert all(0 <= p <= 1 for p in scenario.availability.values())
    assert len({site.name for site in world.sites}) == len(world.sites)


def loaded_instance(folder: Path, content: bytes) -> Instance | None:
    """The instance of this text, checked; ``None`` if there was a complaint."""
    path, again = folder / "instance.json", folder / "again.json"
    path.write_bytes(content)
    with complaints_about(path) as complaints:
        instance = read_instance(path)
    if complaints:
        return None
    text = instance_text(instance)
    assert json.loads(text) == instance_as_dict(instance)
    again.write_text(text, encoding="utf-8")
    assert instance_text(read_instance(again)) == text
    for vehicle in instance.vehicles:
        assert not math.isnan(vehicle.fuel_s.sum())
        assert math.isfinite(vehicle.incentives.sum())
        assert 0 <= vehicle.availability <= 1
    return instance


def check_certificate(folder: Path, instance_content: bytes, plan_content: bytes) -> None:
    instance = loaded_instance(folder, instance_content)
    if instance is None:
        return
    path, again = folder / "plan.json", folder / "plan-again.json"
    path.write_bytes(plan_content)
    with complaints_about(path) as complaints:
        plan = read_plan(path, instance)
        certificate = certify(instance, plan)
        text = json.dumps(certificate.as_dict(), allow_nan=False)
    if complaints:
        return
    for reason in certificate.reasons:
        one_line(reason)
    assert certificate.feasible or certificate.reasons
    assert certificate.feasible is (certificate.expected is not None)
    content = plan_as_dict(plan)
    dumped = json.dumps(content, allow_nan=False)
    again.write_text(dumped, encoding="utf-8")
    read_again = read_plan(again, instance)
    assert json.dumps(plan_as_dict(read_again), allow_nan=False) == dumped
    assert json.dumps(certify(instance, read_again).as_dict(), allow_nan=False) == text


def check_command(folder: Path, instance_content: bytes, plan_content: bytes, as_json: bool) -> None:
    instance, plan = folder / "instance.json", folder / "plan.json"
    instance.write_bytes(instance_content)
    plan.write_bytes(plan_content)
    out, err = io.StringIO(), io.StringIO()
    with warnings.catch_warnings(), redirect_stdout(out), redirect_stderr(err):
        warnings.simplefilter("error")
        code = run_command_line(["certify", str(instance), str(plan), *(["--json"] if as_json else [])])
    assert code in (0, 2, 3), f"exit {code}: {err.getvalue()[:500]}"
    assert "Traceback" not in out.getvalue() + err.getvalue()
    if code == 2:
        assert out.getvalue() == ""
        assert err.getvalue().startswith("error: ")
        assert err.getvalue().count("\n") == 1
    else:
        assert err.getvalue() == ""
        if as_json:
            assert json.loads(out.getvalue())["feasible"] is (code == 0)


def check_planned(folder: Path, content: bytes) -> None:
    instance = loaded_instance(folder, content)
    if instance is None or len(instance.pois) > 4:
        return
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            plan = plan_stochastic(instance, SolveLimits(time_limit_s=2))
        except SvaBenchError as error:
            one_line(str(error))
            return
        certificate = certify(instance, plan)
    assert certificate.feasible, certificate.reasons
    assert not certificate.reasons, certificate.reasons
    assert plan.value is not None
    assert plan.bound is not None
    assert math.isfinite(plan.value)
    assert plan.bound >= plan.value - 1e-6 * max(1.0, abs(plan.value))


@cache
def parsed_world(which: int) -> Any:
    return YAML(typ="safe", pure=True).load(WORLDS[which])


def spoilt_world(which: int, spoil: Edits, block: bool) -> bytes:
    data = spoilt(parsed_world(which % len(WORLDS)), spoil, ODD)
    return as_yaml(data) if block else as_json(data)


def garbled_world(which: int, spoil: Edits) -> bytes:
    return garbled(as_bytes(WORLDS[which % len(WORLDS)]), spoil)


def some_instance(which: int, spoil: Edits, as_text: bool, odd: list[Any] | None = None) -> bytes:
    data = INSTANCES[which % len(INSTANCES)]
    return garbled(as_json(data), spoil) if as_text else as_json(spoilt(data, spoil, odd or ODD))


def some_plan(which: int, spoil: Edits, as_text: bool) -> bytes:
    data = PLANS[which % len(PLANS)]
    return garbled(as_json(data), spoil) if as_text else as_json(spoilt(data, spoil, ODD))


def examples(count: int) -> settings:
    """The same examples every time; a deadline that only a hang misses."""
    return settings(max_examples=count, derandomize=True, database=None, deadline=timedelta(seconds=20),
                    phases=[Phase.generate, Phase.shrink],
                    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fuzz")


spoilt_worlds = st.builds(spoilt_world, choices, edits, st.booleans())
garbled_worlds = st.builds(garbled_world, choices, edits)
instances = st.builds(some_instance, choices, edits, st.booleans())
plans = st.builds(some_plan, choices, edits, st.booleans())
good_instances = st.builds(some_instance, choices, st.just([]), st.just(False))
solvable = st.builds(some_instance, choices, edits, st.just(False), st.just(NUMBERS + [x / 3 for x in range(40)]))


@examples(80)
@given(content=spoilt_worlds)
def test_a_spoilt_world_is_read_or_complained_of(folder: Path, content: bytes) -> None:
    check_world(folder, content)


@examples(80)
@given(content=garbled_worlds)
def test_a_garbled_world_is_read_or_complained_of(folder: Path, content: bytes) -> None:
    check_world(folder, content)


@examples(150)
@given(content=instances)
def test_a_spoilt_instance_is_read_or_complained_of(folder: Path, content: bytes) -> None:
    loaded_instance(folder, content)


@examples(150)
@given(instance=good_instances, plan=plans)
def test_a_spoilt_plan_is_certified_or_complained_of(folder: Path, instance: bytes, plan: bytes) -> None:
    check_certificate(folder, instance, plan)


@pytest.mark.long
@examples(80)
@given(instance=st.one_of(good_instances, instances), plan=plans, as_json=st.booleans())
def test_the_command_certify_ends_in_one_of_its_codes(folder: Path, instance: bytes, plan: bytes, as_json: bool
                                                     ) -> None:
    check_command(folder, instance, plan, as_json)


@examples(40)
@given(content=solvable)
def test_an_odd_instance_is_planned_or_complained_of(folder: Path, content: bytes) -> None:
    check_planned(folder, content)


ODD_WORLDS = {
    "escape": "format: \"\\UFFFFFFFF\"\n",  # OverflowError from the scanner
    "long hexadecimal": SMALL.replace("yaw_deg: 30", "yaw_deg: 0x" + "f" * 5000),  # ValueError as it is shown
    "wall of infinite length": SMALL.replace("[[3.0, 0.0], [3.0, 2.6]]", "[[-1.7e308, 9.0], [1.7e308, 9.0]]"),
    "middle of a wall": SMALL.replace("[[3.0, 0.0], [3.0, 2.6]]", "[[1.7e308, 1.7e308], [1.7e308, 1.6e308]]"),
    "half of the least number": SMALL.replace("size_m: [1.2, 0.5]", "size_m: [5.0e-324, 0.5]")}
ODD_PLANS = {
    "infinite detail": b'"details": {"a": 1e999}',  # is read, can't be written
    "nested details": b'"details": {"a": ' + b"[" * 400 + b"]" * 400 + b'}, "bad": 1'}  # RecursionError for the line


@pytest.mark.parametrize("text", ODD_WORLDS.values(), ids=ODD_WORLDS)
def test_an_odd_world_once_read_wrongly_is_read_or_complained_of(folder: Path, text: str) -> None:
    path, again = folder / "world.yaml", folder / "again.yaml"
    path.write_text(text, encoding="utf-8")
    with complaints_about(path) as complaints:
        world = load_world(path)
    if not complaints:
        again.write_text(json.dumps(world_as_dict(world), allow_nan=False), encoding="utf-8")
        load_world(again)


@pytest.mark.parametrize("rest", ODD_PLANS.values(), ids=ODD_PLANS)
def test_an_odd_plan_once_read_wrongly_is_read_or_complained_of(folder: Path, rest: bytes) -> None:
    path = folder / "plan.json"
    (folder / "instance.json").write_bytes(as_json(TINY))
    path.write_bytes(b'{"format": "sva-bench/plan@1", "routes": {}, ' + rest + b"}")
    with complaints_about(path) as complaints:
        plan = read_plan(path, read_instance(folder / "instance.json"))
    if not complaints:
        json.dumps(plan_as_dict(plan), allow_nan=False)


@pytest.mark.long
@examples(700)
@given(content=spoilt_worlds)
def test_many_spoilt_worlds_are_read_or_complained_of(folder: Path, content: bytes) -> None:
    check_world(folder, content)


@pytest.mark.long
@examples(700)
@given(content=garbled_worlds)
def test_many_garbled_worlds_are_read_or_complained_of(folder: Path, content: bytes) -> None:
    check_world(folder, content)


@pytest.mark.long
@examples(3000)
@given(instance=instances, plan=plans)
def test_many_spoilt_instances_and_plans_are_certified_or_complained_of(folder: Path, instance: bytes, plan: bytes
                                                                       ) -> None:
    check_certificate(folder, instance, plan)


@pytest.mark.long
@examples(1500)
@given(instance=st.one_of(good_instances, instances), plan=plans, as_json=st.booleans())
def test_many_commands_certify_end_in_one_of_their_codes(folder: Path, instance: bytes, plan: bytes, as_json: bool
                                                        ) -> None:
    check_command(folder, instance, plan, as_json)


@pytest.mark.long
@examples(600)
@given(content=solvable)
def test_many_odd_instances_are_planned_or_complained_of(folder: Path, content: bytes) -> None:
    check_planned(folder, content)
