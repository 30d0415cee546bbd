"""Drives shown as they are made."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from numpy.testing import assert_allclose

from sva_bench.__main__ import run_command_line
from sva_bench.execution.outcome import Driven
from sva_bench.recording.live import Live
from sva_bench.recording.rerun import Pen
from sva_bench.study.options import Options
from sva_bench.study.run import measure
from tests.recording.test_rerun import rows
from tests.worlds_for_tests import SMALL, world_of


def test_each_drive_of_a_run_is_shown_as_it_is_made_one_after_the_other(tmp_path: Path) -> None:
    world, path, seen = world_of(tmp_path), tmp_path / "live.rrd", list[tuple[str, Driven]]()
    stream = rr.RecordingStream("live")
    stream.save(path)
    live = Live(world, Pen(stream=stream))

    def watch(who: str, driven: Driven) -> None:
        live(who, driven)
        seen.append((who, driven))

    measure(world, Options(trials=4, rollouts=2, fidelity="kinematic"), None, lambda *_: None, watch)
    stream.flush()
    stream.disconnect()
    assert {who for who, _ in seen} == {"uv1", "uv2"}
    for robot in ("uv1", "uv2"):
        mine = [driven for who, driven in seen if who == robot]
        times, places = rows(path, f"world/drives/{robot}/robot", "Transform3D:translation")
        order = np.argsort(times, kind="stable")
        assert_allclose(np.array(places)[order, 0, :2], np.concatenate([d.pose[:, :2] for d in mine]), atol=1e-6)
        assert (np.diff(times[order]) > 0).all()  # no drive in the time of another
        assert times.max() == pytest.approx(sum(float(d.leg_s.sum()) for d in mine), abs=0.1)
    assert len(rows(path, "world/pois", "Cylinders3D:colors")[0]) == 1


@pytest.mark.parametrize(("screen", "text", "said"), [
    ("", SMALL, "there is no screen here: leave it out"),
    (":0", SMALL.replace("noise:", "interaction: shared\nnoise:"), "robots that meet are played mission by mission"),
])
def test_what_cannot_be_shown_live_is_refused_before_anything_is_done(
        screen: str, text: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("DISPLAY", screen)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    (tmp_path / "small.yaml").write_text(text, encoding="utf-8")
    assert run_command_line(["run", str(tmp_path / "small.yaml"), "--live", "--out", str(tmp_path / "runs")]) == 2
    assert said in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "runs").exists()
