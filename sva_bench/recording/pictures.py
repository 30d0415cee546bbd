"""Pictures: drawn on a canvas, moving as a GIF, and those of the viewer without what is its own: the strip of its
menu, which stays when the menu is hidden. The only importer of PIL but for the reader of maps.
"""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from copy import copy
from functools import cache
from typing import Literal, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from sva_bench.palette import Color

STRIP_PX = 36
"""Height of the viewer's menu."""
_NOTICE_PX = 320, 60  # of a notice at least
_OVER = 2  # canvases are drawn so many times as large, and made smaller: edges are smooth
_COLORS = 64  # of a GIF: what is drawn has few, and their edges

Pixel: TypeAlias = tuple[float, float]
"""A point [px], from the left and from the top."""


class Canvas:
    """A picture to draw on; all lengths are pixels of the picture as it is seen, and need not be integers."""

    def __init__(self, width: int, height: int, paper: Color) -> None:
        self._size, self._paper = (width, height), paper
        self._image = Image.new("RGB", (width * _OVER, height * _OVER), paper)
        self._draw = ImageDraw.Draw(self._image)

    def copy(self) -> Canvas:
        """The same picture, to draw something else on."""
        other = copy(self)
        other._image = self._image.copy()
        other._draw = ImageDraw.Draw(other._image)
        return other

    def pixels(self) -> NDArray[np.uint8]:
        """The picture as it is seen: red, green, blue, shape (height, width, 3)."""
        return np.asarray(self._image.resize(self._size, Image.Resampling.BOX))

    def line(self, corners: Sequence[Pixel], color: Color, width: float) -> None:
        """Draw a line from corner to corner."""
        self._draw.line(_over(corners), fill=color, width=round(width * _OVER))

    def polygon(self, corners: Sequence[Pixel], color: Color, hairline: Color | None = None) -> None:
        """Draw a polygon, with an outline as thin as can be."""
        self._draw.polygon(_over(corners), fill=color, outline=hairline)

    def rectangle(self, corners: Sequence[Pixel], color: Color, outline: Color) -> None:
        """Draw a rectangle between two corners, the upper left one first."""
        self._draw.rectangle(_over(corners), fill=color, outline=outline, width=_OVER)

    def disc(self, at: Pixel, radius: float, color: Color, outline: Color | None = None) -> None:
        """Draw a disc about a point."""
        (x, y), r = at, radius
        self._draw.ellipse(_over([(x - r, y - r), (x + r, y + r)]), fill=color, outline=outline,
                           width=_OVER if outline else 0)

    def text(self, at: Pixel, text: str, size: int, color: Color, *,
             align: Literal["left", "middle", "right"] = "left", halo: bool = False) -> None:
        """Draw a line of text below a point, its left end, middle or right end there; with a halo of paper."""
        self._draw.text(_over([at])[0], text, fill=color, font=_font(size), anchor=f"{align[0]}a",
                        stroke_width=2 * _OVER if halo else 0, stroke_fill=self._paper)


def width_of(text: str, size: int) -> float:
    """How wide a line of text is on a canvas [px]."""
    return _font(size).getlength(text) / _OVER


def gif(frames: Sequence[NDArray[np.uint8]], meant: Sequence[Color], lasts_ms: Sequence[int]) -> bytes:
    """Pictures one after the other as a GIF, over and over.

    Args:
        frames: The pictures, each of shape (height, width, 3).
        meant: Colours that mean something; all of them are in the last picture.
        lasts_ms: How long each picture is seen [ms].
    """
    # One palette for all frames: what stands still is the same in each, and only what moves is written again. It is
    # made from the last frame, which has all colours. Optimised, so that of a frame only what changed is kept.
    images = [Image.fromarray(frame) for frame in frames]
    palette = _with_swatches(images[-1], meant).quantize(
        _COLORS, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    first, *others = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    stream = io.BytesIO()
    first.save(stream, format="GIF", save_all=True, append_images=others, duration=list(lasts_ms), loop=0,
               optimize=True, disposal=1)
    return stream.getvalue()


def _with_swatches(image: Image.Image, colors: Sequence[Color]) -> Image.Image:
    """A picture beside patches of colours that mean something: of a small cross alone the palette would have none."""
    side = math.isqrt(image.width * image.height // 50)
    larger = Image.new("RGB", (image.width + side, max(image.height, side * len(colors))), (255, 255, 255))
    larger.paste(image, (0, 0))
    for number, color in enumerate(colors):
        larger.paste(color, (image.width, number * side, image.width + side, (number + 1) * side))
    return larger


@cache
def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size * _OVER)


def _over(points: Sequence[Pixel]) -> list[Pixel]:
    return [(x * _OVER, y * _OVER) for x, y in points]


def has_notice(png: bytes) -> bool:
    """Whether a viewer that shows nothing yet has a notice where notices appear: at the right, below the menu."""
    with Image.open(io.BytesIO(png)) as picture:
        corner = picture.convert("RGB").crop((picture.width - _NOTICE_PX[0], STRIP_PX + 2, picture.width - 4,
                                              STRIP_PX + _NOTICE_PX[1]))
    channels = cast("tuple[tuple[int, int], ...]", corner.getextrema())
    return any(least != most for least, most in channels)


def without_strip(png: bytes) -> bytes:
    """A picture without the strip at its top."""
    with Image.open(io.BytesIO(png)) as picture:
        cropped = picture.crop((0, STRIP_PX, picture.width, picture.height)).convert("RGB")
    stream = io.BytesIO()
    cropped.save(stream, format="PNG", optimize=True)
    return stream.getvalue()
