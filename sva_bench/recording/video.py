"""Recordings as videos for slides: a time lapse as GIF, or as MP4 by av, an optional extra that is imported here alone.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np
from PIL import Image

from sva_bench.errors import BadInput, ExitCode, SvaBenchError
from sva_bench.palette import ALARM, BLACK, GREEN, YELLOW
from sva_bench.recording.frames import Frames, moments
from sva_bench.recording.read_back import Shown, read_recording

_RATE = 10  # frames a second; a GIF counts in hundredths of one
_LAPSE_S = 15.0  # a mission is shown in about this time, a short one in its own
_HELD_S = 2.0  # the last frame is held
_COLORS = 64  # of a GIF: what is drawn has few, and their edges


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


def _drawn(shown: Shown, progress: Callable[[int, int], None]) -> Iterator[Image.Image]:
    """The frames one after the other."""
    frames, count = Frames(shown), max(round(min(shown.end_s, _LAPSE_S) * _RATE), 2)
    for number, time_s in enumerate(moments(shown.end_s, count).tolist()):
        yield frames.at(time_s)
        progress(number + 1, count)


def _with_swatches(frame: Image.Image, shown: Shown) -> Image.Image:
    """A frame beside patches of the colours that mean something: of a small cross alone the palette would have none."""
    meant = list(dict.fromkeys([ALARM, YELLOW, GREEN, BLACK, *(
        robot.color for plan in shown.plans for robot in plan.robots)]))
    side = math.isqrt(frame.width * frame.height // 50)
    larger = Image.new("RGB", (frame.width + side, max(frame.height, side * len(meant))), (255, 255, 255))
    larger.paste(frame, (0, 0))
    for number, color in enumerate(meant):
        larger.paste(color, (frame.width, number * side, frame.width + side, (number + 1) * side))
    return larger


def _as_gif(shown: Shown, progress: Callable[[int, int], None]) -> bytes:
    # One palette for all frames: what stands still is the same in each, and only what moves is written again. It is
    # made from the last frame, which has all colours. Optimised, so that of a frame only what changed is kept.
    drawn = list(_drawn(shown, progress))
    palette = _with_swatches(drawn[-1], shown).quantize(
        _COLORS, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    frames = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in drawn]
    stream = io.BytesIO()
    lasts = [round(1000 / _RATE)] * (len(frames) - 1) + [round(1000 * _HELD_S)]
    frames[0].save(stream, format="GIF", save_all=True, append_images=frames[1:], duration=lasts, loop=0,
                   optimize=True, disposal=1)
    return stream.getvalue()


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
                video.width, video.height, video.pix_fmt = frame.width, frame.height, "yuv420p"
            container.mux(video.encode(av.VideoFrame.from_ndarray(np.asarray(frame))))
        assert video is not None
        assert frame is not None, "there are two frames at least"
        for _ in range(round(_HELD_S * _RATE)):
            container.mux(video.encode(av.VideoFrame.from_ndarray(np.asarray(frame))))
        container.mux(video.encode())
    return stream.getvalue()


_WRITERS: dict[str, Callable[[Shown, Callable[[int, int], None]], bytes]] = {".gif": _as_gif, ".mp4": _as_mp4}
