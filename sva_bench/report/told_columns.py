"""Columns of tables that tell something, and figures in them that do."""

from __future__ import annotations

from collections.abc import Sequence

NOTHING = "·"
"""What stands for nothing at all in a table of differences: figures are found sooner among dots than among zeros."""


def difference(figure: float) -> str:
    """A difference with its sign; a dot where it would be shown as zero."""
    shown = f"{figure:+.1f}"
    return NOTHING if float(shown) == 0 else shown


def told_columns(
    head: Sequence[str], rows: Sequence[Sequence[str]], always: Sequence[int]
) -> tuple[list[str], list[list[str]]]:
    """Headings and cells without columns that are nothing in every row.

    Args:
        head: Headings.
        rows: Cells.
        always: Columns that stay in any case.
    """
    kept = [k for k in range(len(head)) if k in always or any(row[k] not in ("", NOTHING) for row in rows)]
    return [head[k] for k in kept], [[row[k] for k in kept] for row in rows]
