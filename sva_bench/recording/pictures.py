"""Pictures of the viewer without what is its own: the strip of its menu, which stays when the menu is hidden."""

from __future__ import annotations

import io
from typing import cast

from PIL import Image

STRIP_PX = 36
"""Height of the viewer's menu."""
_NOTICE_PX = 320, 60  # of a notice at least


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
