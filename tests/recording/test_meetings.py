"""Contacts, waits, gates and floors in recordings, of a mission on the line of ``missions``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from sva_bench.execution.outcome import Event, Trace
from sva_bench.recording.colors import ALARM, GREEN
from sva_bench.recording.meetings import floors_of, gates_of, tinted, touched_of, waiting_of
from sva_bench.recording.record import record
from sva_bench.recording.story import story_of
from sva_bench.recording.viewer import verify
from sva_bench.world.model import World
from sva_bench.world.noise import Passage
from tests.recording.missions import WORLD, trace
from tests.recording.test_rerun import rgb, rows

GATES = (Passage(name="d1", ends_m=(4.0, 0.0, 4.0, 2.0), blocked=0.5, wait_s=3.0),
         Passage(name="d2", ends_m=(6.0, 0.0, 6.0, 2.0), blocked=0.5, wait_s=3.0))
FLOORED = replace(WORLD.obstacles, floors=np.array([[2.0, 2.0, 0.5, 0.5, 0.0, 0.05]]))


def world() -> World:
    return replace(WORLD, passages=GATES, obstacles=FLOORED)


def told(end: str | None = None, what: str = "") -> Trace:
    """uv1 waits from 3 to 6 s at d1, and touches the box at 7, 8 and 13 s."""
    plain = trace("uv1")
    events = [Event(time_s=3.0, kind="waits", site="r1", what="d1", lasts_s=3.0, at_m=(3.7, 1.0)),
              *(Event(time_s=t, kind="touches", site="r1", what="box 1", lasts_s=0.2, at_m=(4.0, 2.7))
                for t in (7.0, 8.0, 13.0))]
    last = plain.outcome.events[-1] if end is None else Event(time_s=14.0, kind="stuck", site="base", what=what)
    merged = sorted([*plain.outcome.events[:-1], *events], key=lambda event: event.time_s)
    outcome = replace(plain.outcome, events=(*merged, last), end=plain.outcome.end if end is None else "stuck")
    return replace(plain, outcome=outcome, believed=plain.pose[:, :2] + 0.05)


def test_a_gate_is_shut_as_long_as_a_robot_waits_before_it() -> None:
    shut, other = gates_of(GATES, [told()])
    assert_array_equal(shut.time_s, [0, 3, 6])
    assert shut.shut == (False, True, False)
    assert other.shut == (False,)


def test_contacts_are_named_when_they_are_new() -> None:
    (touched,) = touched_of([told(), trace("uv2")])
    assert touched.what == ("box 1", "", "box 1")  # 8 s is soon after 7 s, 13 s is not
    assert_array_equal(touched.at_m, [[4.0, 2.7]] * 3)


def test_a_wait_ends_with_the_mission_at_the_latest() -> None:
    cut = told()
    cut = replace(cut, outcome=replace(cut.outcome, end_time_s=4.0))
    assert [(wait.since_s, wait.until_s) for wait in waiting_of([cut])] == [(3.0, 4.0)]


def test_floors_that_grip_look_like_any_other_and_ice_does_not() -> None:
    assert tinted(0.8) == tinted(2.0)
    assert tinted(0.05) != tinted(0.8)
    (floor,) = floors_of(FLOORED.floors)
    assert (floor.box, floor.friction) == ((2.0, 2.0, 0.5, 0.5, 0.0), 0.05)


@pytest.mark.parametrize(("what", "said"), [
    ("box 1", "(held by box 1)"), ("tipped over", "(it fell on its side)"),
    ("physics failed", "(physics failed, which gave no finite pose of it)")])
def test_the_log_and_the_mark_say_why_a_robot_is_stuck(what: str, said: str) -> None:
    story = story_of(world(), [told("stuck", what)], "t")
    assert said in story.log[-1].text
    assert said in story.lost[0].what


def test_waits_and_contacts_are_logged() -> None:
    texts = [entry.text for entry in story_of(world(), [told()], "t").log]
    assert "uv1 waits 3 s for d1 on the way to r1" in texts
    assert "uv1 touched box 1, for 0.2 s, on the way to r1" in texts


def test_a_recording_shows_all_of_it(tmp_path: Path) -> None:
    path = tmp_path / "met.rrd"
    record(path, world(), [told(), trace("uv2")], title="met")
    verify(path)
    times, colors = rows(path, "world/passages/d1", "LineStrips3D:colors")
    assert_array_equal(times, [0, 3, 6])
    assert [rgb(row[0]) for row in colors] == [GREEN, ALARM, GREEN]
    times, places = rows(path, "world/contacts/uv1", "Points3D:positions")
    assert_array_equal(times, [7, 8, 13])
    assert_allclose(np.array(places)[:, 0, :2], [[4.0, 2.7]] * 3, atol=1e-6)
    times, labels = rows(path, "world/waits/uv1/what", "Points3D:labels")
    assert_array_equal(times, [3, 6])
    assert labels == [["waits 3 s for d1"], []]
    _, believed = rows(path, "world/believed/uv1", "Transform3D:translation")
    assert_allclose(np.array(believed)[:, 0, :2], told().believed, atol=1e-6)
    assert not rows(path, "world/contacts/uv2", "Points3D:positions")[1]
