"""Tables as notebooks show them: HTML without style or script, everything in them escaped."""

from __future__ import annotations

import html
from collections.abc import Sequence

from sva_bench.files.printable import printable


def notebook_table(caption: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table with a caption."""
    heads = "".join(f"<th>{_text(cell)}</th>" for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{_text(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><caption>{_text(caption)}</caption><thead><tr>{heads}</tr></thead><tbody>{body}</tbody></table>"


def _text(cell: str) -> str:
    return html.escape(printable(cell))
