"""One self-contained page of HTML: nothing in it is loaded from anywhere."""

from __future__ import annotations

import html
import re
from collections.abc import Sequence
from pathlib import Path

from sva_bench.files.printable import printable

_STYLE = """
:root{color-scheme:light}*{box-sizing:border-box}
body{font:16px/1.5 system-ui,sans-serif;max-width:76rem;margin:0 auto;padding:1rem;color:#1b1b1b;background:#fff}
h1,h2,p,li,figcaption{overflow-wrap:anywhere}
h1{font-size:1.5rem;line-height:1.25;margin:.4rem 0}h2{font-size:1.2rem;margin:2.2rem 0 .4rem}
p{margin:.5rem 0}.answer{border-left:.4rem solid #0072B2;background:#eef5fa;padding:.6rem 1rem;margin:.8rem 0}
.answer p:first-child{font-size:1.15rem;font-weight:600;margin-top:0}.answer ul{margin:.3rem 0;padding-left:1.2rem}
.wide{overflow-x:auto}table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:.92rem}
th,td{padding:.3rem .7rem;text-align:right;border-bottom:1px solid #ddd;vertical-align:top}
th{background:#f5f5f5}.text{text-align:left}td.text{white-space:nowrap}
.section{overflow-wrap:anywhere}td.long{white-space:normal;min-width:16rem;overflow-wrap:anywhere}
figure.rows>figcaption{padding-bottom:.3rem}
figure{margin:1rem 0;break-inside:avoid}figure svg{max-width:100%;height:auto;display:block}
figcaption{color:#444;font-size:.92rem}.pair{display:flex;flex-wrap:wrap;gap:1rem}.pair>*{flex:1 1 22rem;min-width:0}
.note{color:#444;font-size:.92rem}code{background:#f3f3f3;padding:.1rem .3rem;overflow-wrap:anywhere}
pre{background:#f3f3f3;padding:.6rem;white-space:pre-wrap}pre code{padding:0}
@media(max-width:40rem){body{font-size:15px}th,td{padding:.25rem .45rem}}
@media print{html,body{font-size:10pt}body{max-width:none;padding:0}.wide{overflow:visible}h2{break-after:avoid}
tr{break-inside:avoid}figure.rows{break-inside:auto}
th,td,td.text{white-space:normal;padding:.15rem .35rem}td.long{min-width:0}a{color:inherit}}
"""


def write_page(path: Path, title: str, parts: Sequence[str]) -> None:
    """Write a page.

    Args:
        path: Where to.
        title: Of the window.
        parts: What stands in it.
    """
    body = "\n".join(parts)
    path.write_text(
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        # An icon of its own, or browsers ask for one.
        '<link rel="icon" href="data:,">'
        f"<title>{text(title)} · sva-bench</title><style>{_STYLE}</style></head>\n"
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
            f"<{tag}{scope}{kind(cell) if k in words else ''}>{text(cell if k in words else _unbroken(cell))}</{tag}>"
            for k, cell in enumerate(cells)) + "</tr>"

    def kind(cell: str) -> str:
        return ' class="text long"' if len(cell) > _LONG else " class=text"

    def above(k: int) -> str:
        if not sections or (k and sections[k] == sections[k - 1]):
            return ""
        return f'<tr><th scope="rowgroup" class="text section" colspan={len(head)}>{text(sections[k])}</th></tr>'

    body = "".join(above(k) + row(cells, "td") for k, cells in enumerate(rows))
    whole = f"<div class=wide tabindex=0><table><thead>{row(head, 'th')}</thead><tbody>{body}</tbody></table></div>"
    # No caption of the table's own: it would be as wide as the table, and scroll out of sight with it.
    return f"<figure class=rows><figcaption>{text(caption)}</figcaption>{whole}</figure>" if caption else whole


_LONG = 40  # letters from which on a name or a route may go on in a second line


def _unbroken(cell: str) -> str:
    """Figures that break nowhere but before an interval or a remark: ``39.0 [36.1, 41.9] (1 map)``."""
    return re.sub(r"(?<=[0-9]) (?![\[(])|(?<=[0-9],) ", "\u00a0", cell)


def figure(picture: str, caption: str) -> str:
    """A picture (SVG) with what it shows."""
    return f"<figure>{picture}<figcaption>{text(caption)}</figcaption></figure>"


def heading(words: str) -> str:
    """A heading."""
    return f"<h2>{text(words)}</h2>"


def note(words: str) -> str:
    """A remark in smaller print."""
    return f"<p class=note>{sentence(words)}</p>"


def sentence(words: str) -> str:
    """As it stands in a paragraph: a line never begins with a per cent sign."""
    return text(re.sub(r"(?<=[0-9]) %", "\u00a0%", words))


def text(value: object) -> str:
    """As it stands in a page."""
    return html.escape(printable(str(value)))
