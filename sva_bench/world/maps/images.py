"""Pictures of maps as grey levels. The only importer of PIL, which recognises the formats by their content."""

from __future__ import annotations

import io
import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from sva_bench.arrays import BoolArray
from sva_bench.world.maps.plain_images import plain_levels, plain_size

MAX_CELLS = 16_000_000  # 4000 x 4000: four times the largest map of the benchmarks
_FORMATS = ("PPM", "PNG", "BMP")  # PIL's name of the PGM family is PPM
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"  # written by some editors before plain (ASCII) images
_DEEP = ("I", "I;16", "I;16B", "I;16L", "I;16N")  # 16 bits a pixel


class BadImage(ValueError):
    """An image that cannot be read; the message says why."""


@dataclass(frozen=True, eq=False, kw_only=True)
class GreyImage:
    """A picture in 8-bit grey.

    Attributes:
        level: 0 (black) to 255 (white), the top row first; shape (rows, columns).
        opaque: Which pixels are fully opaque; ``None`` without an alpha channel.
    """

    level: NDArray[np.uint8]
    opaque: BoolArray | None


def grey_image(content: bytes) -> GreyImage:
    """Decode a PGM, PNG or BMP picture; colours become their luminance (ITU-R 601), 16 bits become 8.

    The size is checked before anything is decoded.

    Raises:
        BadImage: If it is none of these, is broken, or has more than ``MAX_CELLS`` pixels.
    """
    content = content.removeprefix(_BYTE_ORDER_MARK)
    try:
        if (size := plain_size(content)) is not None:
            _refuse_size(*size)
            return _plain_grey(content)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # PIL warns of large images; our limit is stricter
            with Image.open(io.BytesIO(content), formats=_FORMATS) as image:
                columns, rows = image.size
                _refuse_size(columns, rows)
                image.load()
                return _grey(image)
    except BadImage:
        raise
    except Image.DecompressionBombError:
        raise BadImage(f"it has far more than the {MAX_CELLS} pixels that are read") from None
    except Exception as error:  # PIL raises whatever its decoders meet: OSError, SyntaxError, struct.error, ...
        what = " ".join(str(error).split())[:100] or type(error).__name__
        if type(error).__name__ == "UnidentifiedImageError":
            what = "neither PGM nor PNG nor BMP"
        raise BadImage(f"it is no picture that can be read: {what}") from None


def _refuse_size(columns: int, rows: int) -> None:
    if columns < 1 or rows < 1:
        raise BadImage(f"it has {columns} x {rows} pixels")
    if columns * rows > MAX_CELLS:
        raise BadImage(f"it has {columns} x {rows} pixels; at most {MAX_CELLS} are read")


def _plain_grey(content: bytes) -> GreyImage:
    """Plain (ASCII) images, for which PIL takes 3 GB at 4000 x 4000 pixels."""
    level = plain_levels(content)
    level *= 255  # in place: 128 MB at the most cells that are read
    deep = np.round(level, out=level).astype(np.uint8)
    if deep.ndim == 3:
        deep = np.array(Image.fromarray(deep).convert("L"))
    return GreyImage(level=deep, opaque=None)


def _grey(image: Image.Image) -> GreyImage:
    if image.mode in _DEEP:
        deep = np.asarray(image, dtype=np.float64)
        return GreyImage(level=np.round(np.clip(deep, 0, 65535) / 257).astype(np.uint8), opaque=None)
    if image.mode in ("F", "CMYK"):
        raise BadImage(f"pictures of the kind {image.mode} are not maps; save it as 8-bit grey")
    opaque: BoolArray | None = None
    if image.mode in ("LA", "PA", "RGBA") or "transparency" in image.info:
        image = image.convert("RGBA")
        opaque = np.asarray(image)[..., 3] == 255
    if image.mode not in ("1", "L"):
        image = image.convert("RGB")
    return GreyImage(level=np.array(image.convert("L")), opaque=opaque)
