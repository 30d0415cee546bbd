"""One self-contained page of HTML: nothing in it is loaded from anywhere."""

from __future__ import annotations

import html
import re
import shlex
from collections.abc import Sequence
from pathlib import Path

from sva_bench.files.printable import printable
from sva_bench.report.page_style import STYLE


def write_page(path: Path, title: str, parts: Sequence[str]) -> None:
    """Write a page.

    Args:
        path: Where to.
        title: Of the window.
        parts: What stands in it; where one is ``CONTENTS``, links to its headings.
    """
    body = "\n".join(parts)
    headings = re.findall(r'<h2 id="([^"]+)">(.*?)</h2>', body)
    links = "".join(f'<a href="#{name}">{words}</a>' for name, words in headings)
    body = body.replace(CONTENTS, f'<nav aria-label="Contents">{links}</nav>' if len(headings) > 1 else "", 1)
    path.write_text(
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        # An icon of its own, or browsers ask for one.
        '<link rel="icon" href="data:,">'
        f"<title>{text(title)} · sva-bench</title><style>{STYLE}</style></head>\n"
        f"<body>\n{body}\n</body></html>\n", encoding="utf-8")


def table(
    head: Sequence[str], rows: Sequence[Sequence[str]], *, words: Sequence[int] = (0,), caption: str = "",
    sections: Sequence[str] = (),
) -> str:
    """A table that scrolls sideways where a window is narrow; what it shows stays in sight above it.

    Figures break before their interval where there is little room, names and words only where they are long.

    Args:
        head: Headings.
        rows: Cells.
        words: Columns of words; all others are of figures.
        caption: What it shows.
        sections: What each row belongs to, if anything; said once, above the first of them, across all columns.
    """
    def row(cells: Sequence[str], tag: str) -> str:
        scope = ' scope="col"' if tag == "th" else ""
        return "<tr>" + "".join(
            f"<{tag}{scope}{kind(cell) if k in words else ''}>{text(cell) if k in words else _figures(cell)}</{tag}>"
            for k, cell in enumerate(cells)) + "</tr>"

    def kind(cell: str) -> str:
        return ' class="text long"' if len(cell) > _LONG else " class=text"

    def above(k: int) -> str:
        return "" if not sections else \
            f'<tr><th scope="rowgroup" class="text section" colspan={len(head)}>{text(sections[k])}</th></tr>'

    bodies = "</tbody><tbody>".join(  # a body for each section: print breaks between them
        above(first) + "".join(row(cells, "td") for cells in rows[first:last])
        for first, last in _sections(sections, len(rows)))
    kept = "<table class=few>" if len(rows) <= (_FEW_IN_SECTIONS if sections else _FEW) else "<table>"
    whole = f"<div class=wide tabindex=0>{kept}<thead>{row(head, 'th')}</thead><tbody>{bodies}</tbody></table></div>"
    # No caption of the table's own: it would be as wide as the table, and scroll out of sight with it.
    return f"<figure class=rows><figcaption>{sentence(caption)}</figcaption>{whole}</figure>" if caption else whole


def _sections(names: Sequence[str], rows: int) -> list[tuple[int, int]]:
    """First row and end of each run of rows with the same name."""
    starts = [k for k in range(rows) if not k or (names and names[k] != names[k - 1])]
    return list(zip(starts, [*starts[1:], rows], strict=True))


def table_of_html(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of words, whose cells are HTML."""
    above = "".join(f'<th scope="col" class=text>{text(word)}</th>' for word in head)
    body = "".join("<tr>" + "".join(f"<td class=text>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    return (f"<div class=wide tabindex=0><table class=few><thead><tr>{above}</tr></thead><tbody>{body}</tbody></table>"
            "</div>")


CONTENTS = "<!--contents-->"
"""Where a page has its contents."""
_FEW, _FEW_IN_SECTIONS = 24, 8  # rows that print keeps on one sheet
_LONG = 40  # letters from which on a name or a route may go on in a second line


def _figures(cell: str) -> str:
    """Figures that break nowhere but before an interval or a remark: ``39.0 [36.1, 41.9] (1 map)``."""
    return text(re.sub(r"(?<=[0-9]) (?![\[(])|(?<=[0-9],) ", "\u00a0", typeset(cell)))


def figure(picture: str, caption: str) -> str:
    """A picture (SVG) with what it shows."""
    return f"<figure>{picture}<figcaption>{sentence(caption)}</figcaption></figure>"


def heading(words: str) -> str:
    """A heading, which the contents lead to."""
    return f'<h2 id="{_slug(words)}">{text(words)}</h2>'


def _slug(words: str) -> str:
    return re.sub(r"[^a-z0-9]+", "_", words.lower()).strip("_")


def details(summary: str, inner: str, *, opened: bool = False) -> str:
    """Something folded away below a line that says what it is; open in print.

    Args:
        summary: The line, as HTML.
        inner: What is folded away, as HTML.
        opened: Whether it is open at first.
    """
    return f"<details{' open' if opened else ''}><summary>{summary}</summary>{inner}</details>"


def folded(parts: Sequence[str]) -> list[str]:
    """A section folded away below its heading; nothing stays nothing."""
    return [details(parts[0], "\n".join(parts[1:]))] if parts else []


def note(words: str) -> str:
    """A remark in smaller print."""
    return f"<p class=note>{sentence(words)}</p>"


def command(words: Sequence[str]) -> str:
    """A command line that breaks between its words only, or within one that is longer than a line."""
    return "<pre><code>" + " ".join(
        f"<span class=whole>{text(shlex.quote(word))}</span>" for word in words) + "</code></pre>"


def sentence(words: str) -> str:
    """As it stands in a paragraph: a line never begins with a per cent sign, nor ends within an option's name."""
    kept = text(typeset(re.sub(r"(?<=[0-9]) %", "\u00a0%", words)))
    return _WHOLE.sub(r"<span class=whole>\g<0></span>", kept)


_WHOLE = re.compile(r"(?<![\w-])--[a-z][a-z-]*|[0-9.]+–[0-9.]+")
"""Options and ranges break nowhere. Copied from a page, an option must be one still: so no other hyphens in it."""


def typeset(words: str) -> str:
    """Figures with a true minus sign, which a zero never has; names, options and dates keep their hyphens."""
    return _MINUS.sub("\u2212", _MINUS_ZERO.sub("", words))


_MINUS = re.compile(r"(?<![\w.\-/)\]])-(?=\.?[0-9])")
_MINUS_ZERO = re.compile(r"(?<![\w.\-/)\]])-(?=0(?:\.0+)?(?!\.?[0-9e]))")


def text(value: object) -> str:
    """As it stands in a page."""
    return html.escape(printable(str(value)))
