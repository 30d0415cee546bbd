"""Videos: what a recording shows is read back from it, and drawn from above."""

from __future__ import annotations

import io
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image, ImageDraw

from sva_bench.errors import BadFile, BadInput
from sva_bench.palette import ALARM, GREEN, ROBOTS, YELLOW
from sva_bench.recording.about import About
from sva_bench.recording.frames import Frames
from sva_bench.recording.read_back import Shown, read_recording
from sva_bench.recording.record import Side, record, record_pair
from sva_bench.recording.video import NoVideoEncoder, kind_of, video_of
from tests.recording.missions import WORLD, trace

TRACES = [trace("uv1"), trace("uv2", fails_before=2), trace("uv3", ())]


def quiet(*_: int) -> None:
    """Nobody follows."""


@pytest.fixture(scope="module")
def tour(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recording") / "tour.rrd"
    record(path, WORLD, TRACES, title="tour")
    return path


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recording") / "pair.rrd"
    record_pair(path, WORLD, [Side(
        about=About(scenario="nominal", planner=name, trial=3, seed=1, fidelity="rollout"), traces=traces,
        routes={t.orders.robot: t.orders.route for t in traces}) for name, traces in (
            ("stochastic", TRACES[:2]), ("a plan/of (mine)", TRACES[1:]))], title="pair")
    return path


def test_what_is_read_back_is_what_was_recorded(tour: Path) -> None:
    shown = read_recording(tour)
    assert (shown.title, shown.end_s) == ("tour", 14.0)
    (plan,) = shown.plans
    assert_allclose(plan.bounds_m, WORLD.obstacles.bounds_m, atol=1e-6)
    assert_allclose(plan.cylinders, WORLD.obstacles.cylinders, atol=1e-6)
    assert np.abs(plan.boxes - WORLD.obstacles.boxes[0]).max(axis=1).min() < 1e-6  # among the walls
    assert {site for sites in plan.sites for site in sites.names} == {site.name for site in WORLD.sites}
    for robot, expected in zip(plan.robots, TRACES, strict=True):
        assert robot.name == expected.orders.robot
        assert_allclose(robot.pose[:, :2], expected.pose[:, :2], atol=1e-6)
        assert robot.collected.values[-1] == expected.outcome.incentive
        assert (robot.lost is None) == (not expected.outcome.lost)
    assert plan.robots[1].lost == (6.0, "uv2 failed at 6 s")
    # uv2 failed with p2 ahead, but uv1 collected it; uv3 had nothing to do.
    assert [len(robot.forgone) for robot in plan.robots] == [0, 0, 0]


def test_pois_that_a_lost_robot_leaves_to_nobody_are_crossed_out_from_then_on(tmp_path: Path) -> None:
    path = tmp_path / "alone.rrd"
    record(path, WORLD, [trace("uv2", fails_before=2)], title="alone")
    ((robot,),) = (plan.robots for plan in read_recording(path).plans)
    assert robot.forgone_s == 6.0
    assert_allclose(robot.forgone.mean(axis=(0, 1)), (7.0, 1.0), atol=1e-6)  # p2


def test_two_plans_are_read_back_by_their_names(pair: Path) -> None:
    shown = read_recording(pair)
    assert [plan.name for plan in shown.plans] == ["stochastic", "a plan/of (mine)"]
    assert [[robot.name for robot in plan.robots] for plan in shown.plans] == [["uv1", "uv2"], ["uv2", "uv3"]]


def test_a_robot_is_drawn_where_it_is_and_crossed_out_once_it_is_lost(tour: Path) -> None:
    shown = read_recording(tour)
    frames = Frames(shown)
    before, after = (np.asarray(frames.at(time_s)).astype(int) for time_s in (5.9, 6.1))
    assert before.shape == (frames.height, frames.width, 3)
    reddish = [(np.abs(frame - [208, 0, 0]).sum(axis=-1) < 60).sum() for frame in (before, after)]
    assert reddish[1] > reddish[0] + 50  # the cross, and the word in its row
    with pytest.raises(ValueError, match="ascend"):
        frames.at(3.0)


@pytest.mark.long
def test_a_gif_shows_the_whole_mission_and_is_the_same_each_time(pair: Path) -> None:
    content = video_of(pair, ".gif", quiet)
    assert content == video_of(pair, ".gif", quiet)
    assert len(content) < 2e6
    with Image.open(io.BytesIO(content)) as video:
        first, frames = np.asarray(video.convert("RGB")).astype(int), getattr(video, "n_frames", 1)
        lasts_ms = []
        for number in range(frames):
            video.seek(number)
            lasts_ms.append(video.info["duration"])
        # A short mission takes its own time, and its last frame is held; frames that are alike are one.
        assert sum(lasts_ms) / 1000 == pytest.approx(14 + 2, abs=0.11)
        assert np.abs(np.asarray(video.convert("RGB")).astype(int) - first).max() > 100


def words_drawn(shown: Shown, time_s: float, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """All that is written on a frame."""
    said: list[str] = []
    write = ImageDraw.ImageDraw.text

    def writing(draw: ImageDraw.ImageDraw, at: tuple[float, float], text: str, **how: Any) -> None:
        said.append(text)
        write(draw, at, text, **how)

    with monkeypatch.context() as patch:
        patch.setattr(ImageDraw.ImageDraw, "text", writing)
        Frames(shown).at(time_s)
    return said


def test_a_frame_says_what_its_marks_mean_and_whose_fuel_is_left(tour: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shown = read_recording(tour)
    before, after = (words_drawn(shown, time_s, monkeypatch) for time_s in (5.9, 6.1))
    assert {"tour", "lost robot", "POI that it left", "planned", "driven", "station", "base"} <= set(before)
    # Both drive the same route, and are full at the station; what the one that failed has left is nobody's.
    assert [text for text in before if text.startswith("fuel")] == ["fuel 20 s", "fuel 20 s"]
    assert [text for text in after if text.startswith("fuel")] == ["fuel 20 s"]
    assert "uv1, uv2" in after  # in one place
    assert "collected 30" in after


def test_the_legend_fits_whatever_the_width(tour: Path) -> None:
    shown = read_recording(tour)
    (plan,) = shown.plans
    x0, y0, x1, _ = plan.bounds_m
    tall = replace(plan, bounds_m=(x0, y0, x1, y0 + 10 * (x1 - x0)))
    narrow, wide = Frames(replace(shown, plans=[tall])), Frames(shown)
    assert narrow.width < wide.width
    pixels = np.asarray(narrow.at(0.0)).astype(int)
    assert (pixels[:, -10:].min() > 200), "nothing is cut at the right"
    red = (np.abs(pixels - [208, 0, 0]).sum(axis=-1) < 60)
    assert red[-100:].any(), "the cross of lost robots is in the legend"


@pytest.mark.long
def test_a_gif_has_the_colours_that_mean_something_however_small_what_they_paint_is(tmp_path: Path) -> None:
    solids = replace(WORLD.obstacles, bounds_m=np.array([-200.0, -200.0, 200.0, 200.0]))
    path = tmp_path / "large.rrd"
    record(path, replace(WORLD, obstacles=solids), TRACES, title="large")
    with Image.open(io.BytesIO(video_of(path, ".gif", quiet))) as video:
        video.seek(video.n_frames - 1)  # type: ignore[attr-defined]
        last = np.asarray(video.convert("RGB")).astype(int)
    for color in (ALARM, GREEN, YELLOW, *ROBOTS[:3]):
        assert np.abs(last - color).sum(axis=-1).min() < 12, color


@pytest.mark.long
def test_an_mp4_has_the_same_frames_and_is_the_same_each_time(tour: Path) -> None:
    av = pytest.importorskip("av")
    content = video_of(tour, ".mp4", quiet)
    assert content == video_of(tour, ".mp4", quiet)
    frames = Frames(read_recording(tour))
    with av.open(io.BytesIO(content)) as container:
        pictures = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert len(pictures) == (14 + 2) * 10
    assert np.abs(pictures[0].astype(int) - np.asarray(frames.at(0.0)).astype(int)).mean() < 4  # lossy
    assert_array_equal(pictures[0].shape, (frames.height, frames.width, 3))


def test_other_kinds_and_missing_encoders_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    assert kind_of(Path("A.GIF")) == ".gif"
    with pytest.raises(BadInput, match=r"end in \.gif or \.mp4"):
        kind_of(Path("a.avi"))
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(NoVideoEncoder, match=r"pip install 'sva-bench\[video\]', or name a \.gif"):
        kind_of(Path("a.mp4"))
    assert kind_of(Path("a.gif")) == ".gif"


def test_a_recording_of_something_else_is_refused(tmp_path: Path) -> None:
    import rerun as rr

    stream = rr.RecordingStream("other")
    stream.save(tmp_path / "other.rrd")
    stream.log("points", rr.Points3D([[0, 0, 0]]))
    stream.flush()
    stream.disconnect()
    with pytest.raises(BadFile, match="no recording of a mission"):
        video_of(tmp_path / "other.rrd", ".gif", quiet)
