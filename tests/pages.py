"""Pages as people read them."""

from __future__ import annotations

import html
import re
from pathlib import Path


def read(page: Path) -> str:
    """The text of a page without tags, as if all of it were typed."""
    return plain(page.read_text(encoding="utf-8"))


def plain(shown: str) -> str:
    """HTML without tags: words with plain spaces, and figures with plain signs."""
    return untypeset(html.unescape(re.sub(r"<[^>]*>", "", shown)))


def untypeset(shown: str) -> str:
    """The same of what is to keep its tags."""
    without = re.sub(r"<span class=whole>(.*?)</span>", r"\1", shown)
    return without.replace("\u00a0", " ").replace("\u2212", "-")
