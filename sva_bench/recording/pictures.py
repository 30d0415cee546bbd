"""Pictures of the viewer without what is its own: the strip of its menu, which stays when the menu is hidden."""

from __future__ import annotations

import io

from PIL import Image

STRIP_PX = 36
"""Height of the viewer's menu."""


def without_strip(png: bytes) -> bytes:
    """A picture without the strip at its top."""
    with Image.open(io.BytesIO(png)) as picture:
        cropped = picture.crop((0, STRIP_PX, picture.width, picture.height)).convert("RGB")
    stream = io.BytesIO()
    cropped.save(stream, format="PNG", optimize=True)
    return stream.getvalue()
