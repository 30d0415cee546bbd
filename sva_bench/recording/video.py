"""Recordings as videos for slides: a time lapse as GIF, or as MP4 by av, an optional extra that is imported here alone.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sva_bench.errors import BadInput, ExitCode, SvaBenchError
from sva_bench.palette import ALARM, BLACK, GREEN, YELLOW
from sva_bench.recording.frames import Frames, moments
from sva_bench.recording.pictures import gif
from sva_bench.recording.read_back import Shown, read_recording

_RATE = 10  # frames a second; a GIF counts in hundredths of one
_LAPSE_S = 15.0  # a mission is shown in about this time, a short one in its own
_HELD_S = 2.0  # the last frame is held


class NoVideoEncoder(SvaBenchError):
    """The library that writes MP4 is not installed."""

    exit_code = ExitCode.FAULT  # of the installation

    def __init__(self) -> None:
        super().__init__()

    def __str__(self) -> str:
        return ("--video: the library that writes MP4 isn't installed; pip install 'sva-bench[video]', or name a .gif, "
                "which needs nothing more")


def kind_of(path: Path) -> str:
    """``.gif`` or ``.mp4``, whichever a video is to be.

    Raises:
        BadInput: If it is neither.
        NoVideoEncoder: If it is an MP4, and the library for it isn't installed.
    """
    kind = path.suffix.lower()
    if kind not in _WRITERS:
        raise BadInput(f"--video {path}: let its name end in .gif or .mp4")
    if kind == ".mp4":
        try:
            import av  # noqa: F401
        except ImportError:
            raise NoVideoEncoder from None
    return kind


def video_of(recording: Path, kind: str, progress: Callable[[int, int], None]) -> bytes:
    """A recording as the content of a video.

    Args:
        recording: The ``.rrd`` file.
        kind: As ``kind_of`` gives it.
        progress: Called with how many frames are drawn, and of how many.

    Raises:
        BadFile: If it is no recording of a mission.
    """
    return _WRITERS[kind](read_recording(recording), progress)


def _drawn(shown: Shown, progress: Callable[[int, int], None]) -> Iterator[NDArray[np.uint8]]:
    """The frames one after the other, each of shape (height, width, 3)."""
    frames, count = Frames(shown), max(round(min(shown.end_s, _LAPSE_S) * _RATE), 2)
    for number, time_s in enumerate(moments(shown.end_s, count).tolist()):
        yield frames.at(time_s)
        progress(number + 1, count)


def _as_gif(shown: Shown, progress: Callable[[int, int], None]) -> bytes:
    frames = list(_drawn(shown, progress))
    meant = list(dict.fromkeys([ALARM, YELLOW, GREEN, BLACK, *(
        robot.color for plan in shown.plans for robot in plan.robots)]))
    return gif(frames, meant, [round(1000 / _RATE)] * (len(frames) - 1) + [round(1000 * _HELD_S)])


def _as_mp4(shown: Shown, progress: Callable[[int, int], None]) -> bytes:
    import av

    stream = io.BytesIO()
    with av.open(stream, mode="w", format="mp4") as container:
        video = None
        frame = None
        for frame in _drawn(shown, progress):
            if video is None:
                video = container.add_stream("libx264", rate=Fraction(_RATE), options={
                    "crf": "22", "threads": "1", "tune": "animation"})  # of several threads bytes could differ
                (video.height, video.width, _), video.pix_fmt = frame.shape, "yuv420p"
            container.mux(video.encode(av.VideoFrame.from_ndarray(frame)))
        assert video is not None
        assert frame is not None, "there are two frames at least"
        for _ in range(round(_HELD_S * _RATE)):
            container.mux(video.encode(av.VideoFrame.from_ndarray(frame)))
        container.mux(video.encode())
    return stream.getvalue()


_WRITERS: dict[str, Callable[[Shown, Callable[[int, int], None]], bytes]] = {".gif": _as_gif, ".mp4": _as_mp4}
