"""How pages look: legible in light and dark, on a phone, in a window and in print, without anything from elsewhere."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
from collections.abc import Mapping
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from sva_bench.report.page import (
    CONTENTS,
    command,
    details,
    folded,
    heading,
    sentence,
    table,
    typeset,
    write_page,
)
from sva_bench.report.page_style import DARK, LIGHT, STYLE
from sva_bench.report.panels import MOST_PANELS, Axes, Panel, Point, panels
from sva_bench.report.results_charts import MOST_DOTS, _of_trials
from sva_bench.report.rows_chart import Dot, Row, Span, Steps, round_ticks, rows_chart
from sva_bench.report.told_columns import NOTHING, difference, told_columns
from sva_bench.study.options import Options
from sva_bench.study.run import run
from tests.test_palette import contrast, rgb_of
from tests.worlds_for_tests import SMALL, world_of

BROWSER = next((found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))),
               None)
VOID = {"meta", "link", "br", "img", "input", "hr"}


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of a run with all that pages have."""
    folder = tmp_path_factory.mktemp("page")
    text = SMALL.replace("noise: {wheel_gain_sd: 0.01}", "noise: realistic") + \
        "reaction: {policy: resolve, news: report}\nfailure: per_leg\n"
    done = run(world_of(folder, text), Options(trials=20, rollouts=4, fidelity="kinematic"), folder / "runs", None,
               lambda *_: None)
    return done.folder / "report.html"


class Balanced(HTMLParser):
    """Tags that are open, and what is wrong with them."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.wrong: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in VOID:
            self.open.append(tag)
        names = [name for name, _ in attrs]
        if len(names) != len(set(names)):
            self.wrong.append(f"{tag} has an attribute twice: {names}")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Closes itself."""

    def handle_endtag(self, tag: str) -> None:
        if not self.open or self.open.pop() != tag:
            self.wrong.append(f"{tag} is closed where it isn't open, at {self.getpos()}")


def test_every_tag_is_closed_where_it_was_opened(page: Path) -> None:
    found = Balanced(page.read_text(encoding="utf-8"))
    assert found.wrong == []
    assert found.open == []


def test_a_page_has_no_address_from_elsewhere_and_no_script(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    addresses = set(re.findall(r"[a-z]+://[^\s\"'<>)]+", text))
    assert addresses <= {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}  # names of languages
    assert not re.search(r"<script|\bon[a-z]+=|javascript:|@import|<iframe|<object", text)
    assert page.stat().st_size < 1_500_000


def test_contents_lead_to_each_heading(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    nav = re.search(r"<nav.*?</nav>", text)
    assert nav
    assert re.findall(r'href="#([^"]+)"', nav[0]) == re.findall(r'<h2 id="([^"]+)"', text)
    assert text.index("<nav") < text.index("<h2")


def test_a_page_of_one_heading_has_no_contents(tmp_path: Path) -> None:
    write_page(tmp_path / "page.html", "title", [CONTENTS, heading("One")])
    assert "<nav" not in (tmp_path / "page.html").read_text(encoding="utf-8")


# Colours


@pytest.mark.parametrize("mode", [LIGHT, DARK], ids=["light", "dark"])
@pytest.mark.parametrize("ground", ["paper", "answer", "fill", "free"])
@pytest.mark.parametrize("letters", ["ink", "soft", "link"])
def test_text_has_a_contrast_of_at_least_four_and_a_half(mode: Mapping[str, str], ground: str, letters: str) -> None:
    assert contrast(rgb_of(mode[letters]), rgb_of(mode[ground])) >= 4.5


def test_every_colour_variable_that_a_page_uses_is_there_in_both_modes(page: Path) -> None:
    used = set(re.findall(r"var\(--([a-z]+)", page.read_text(encoding="utf-8"))) - {"plan", "other", "often"}
    assert used <= set(LIGHT)
    assert set(LIGHT) == set(DARK)
    assert len(used) >= 8


def test_no_letter_or_line_of_a_chart_is_black_in_the_dark(page: Path) -> None:
    pictures = re.findall(r"<svg.*?</svg>", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    assert len(pictures) > 5
    for picture in pictures:
        assert not re.search(r"(fill|stroke): ?(#000000|#ffffff|black|white)", picture)


# In a browser


_SIZES = """<script>onload=()=>{const d=document.querySelector('iframe').contentDocument;
d.querySelectorAll('details').forEach(e=>e.open=true);
const w=d.documentElement.clientWidth, all=[...d.body.querySelectorAll('*')];
const out=all.filter(e=>!e.closest('.wide')&&!e.closest('svg')&&e.getBoundingClientRect().right>w+1);
const cut=all.filter(e=>!e.closest('svg')&&!e.matches('.wide')&&getComputedStyle(e).overflowX!='visible'&&
e.scrollWidth>e.clientWidth+1);
const wide=[...d.querySelectorAll('.wide')].filter(e=>e.scrollWidth>e.clientWidth+1);
document.title=JSON.stringify({window:w,page:d.documentElement.scrollWidth,out:out.map(e=>e.outerHTML.slice(0,80)),
cut:cut.map(e=>e.outerHTML.slice(0,80)),scrolls:wide.length,
signs:wide.filter(e=>getComputedStyle(e).backgroundImage.split('gradient').length==5).length,
ink:getComputedStyle(d.body).color,paper:getComputedStyle(d.body).backgroundColor,
overlaps:[...d.querySelectorAll('.map,figure')].filter(e=>[...e.children].reduce(
(sum,c)=>sum+c.getBoundingClientRect().height,0)>e.getBoundingClientRect().height+2).length,
maps:[...d.querySelectorAll('.map svg:not(.k)')].map(e=>Math.round(e.getBoundingClientRect().width)),
letters:Math.min(...[...d.querySelectorAll('.map svg text,svg.rows text,svg.panel text')].map(
e=>parseFloat(getComputedStyle(e).fontSize)*e.closest('svg').getScreenCTM().a))})}</script>"""


def seen(page: Path, width: int, tmp_path: Path, *options: str, printed: bool = False) -> dict[str, Any]:
    """What a browser makes of a page in a frame of some width: a window of its own can't be that narrow."""
    frame = tmp_path / "frame.html"
    text = page.read_text(encoding="utf-8").replace("@media print{", "@media all{" if printed else "@media print{")
    inner = html.escape(text, quote=True)
    frame.write_text(f'<!doctype html><body><iframe width={width} height=3000 style="border:0" srcdoc="{inner}">'
                     f"</iframe>{_SIZES}</body>", encoding="utf-8")
    done = subprocess.run(
        [str(BROWSER), "--headless", "--no-sandbox", "--disable-gpu", "--window-size=1500,3000", *options,
         f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom", frame.as_uri()],
        capture_output=True, text=True, timeout=120)
    found = re.search(r"<title>(.*?)</title>", done.stdout)
    assert found, done.stderr
    sizes: dict[str, Any] = json.loads(html.unescape(found[1]))
    return sizes


@pytest.mark.skipif(BROWSER is None, reason="no browser here")
@pytest.mark.parametrize("width", [390, 768, 1400])
def test_nothing_is_cut_without_a_sign_at_any_width(page: Path, width: int, tmp_path: Path) -> None:
    found = seen(page, width, tmp_path)
    assert found["window"] in range(width - 20, width + 1)
    assert found["page"] <= found["window"]
    assert found["out"] == []
    assert found["cut"] == []
    assert found["signs"] == found["scrolls"]  # a shadow where a table goes on
    assert (found["scrolls"] > 0) == (width < 1400)
    assert found["overlaps"] == 0
    assert min(found["maps"]) > (300 if width < 1400 else 400)
    assert found["letters"] >= 8  # in pixels of the style sheet: a phone's own are finer by two or three


@pytest.mark.skipif(BROWSER is None, reason="no browser here")
@pytest.mark.parametrize(("scheme", "mode"), [(1, LIGHT), (0, DARK)], ids=["light", "dark"])
def test_a_page_is_as_dark_as_its_reader_wants(
        scheme: int, mode: Mapping[str, str], page: Path, tmp_path: Path) -> None:
    found = seen(page, 768, tmp_path, f"--blink-settings=preferredColorScheme={scheme}")
    for name, said in (("ink", found["ink"]), ("paper", found["paper"])):
        assert tuple(map(int, re.findall(r"\d+", said)[:3])) == rgb_of(mode[name])


@pytest.mark.skipif(BROWSER is None, reason="no browser here")
def test_nothing_overlaps_or_is_cut_in_print(page: Path, tmp_path: Path) -> None:
    found = seen(page, 720, tmp_path, printed=True)  # about what a sheet of A4 has
    assert found["overlaps"] == 0
    assert found["page"] <= found["window"]
    assert found["out"] == []
    assert min(found["maps"]) > 300


@pytest.mark.long
@pytest.mark.skipif(BROWSER is None, reason="no browser here")
def test_print_holds_what_is_folded_away(page: Path, tmp_path: Path) -> None:
    def pages_of(text: str) -> int:
        (tmp_path / "page.html").write_text(text, encoding="utf-8")
        subprocess.run([str(BROWSER), "--headless", "--no-sandbox", "--disable-gpu",
                        f"--user-data-dir={tmp_path / 'profile'}", f"--print-to-pdf={tmp_path / 'page.pdf'}",
                        (tmp_path / "page.html").as_uri()], capture_output=True, check=True, timeout=120)
        return len(re.findall(rb"/Type\s*/Page\b", (tmp_path / "page.pdf").read_bytes()))

    text = page.read_text(encoding="utf-8")
    assert "<details><summary>" in text
    assert pages_of(text) == pages_of(text.replace("<details>", "<details open>")) > 3
    assert pages_of(text) > pages_of(re.sub(r"details::details-content\{[^}]*\}", "", text))


# Tables, folding and charts


@pytest.mark.parametrize(("words", "shown"), [
    ("-1.5 [-2, -.5], (-3 %) and 4-5", "−1.5 [−2, −.5], (−3 %) and 4-5"),
    ("-0.0 [-0.00, 0.1] and -0", "0.0 [0.00, 0.1] and 0"),
    ("-0.04", "−0.04"), ("uv-1, 2026-11-26, a/-1, --gap and p.-1", "uv-1, 2026-11-26, a/-1, --gap and p.-1"),
    ("-0e-5", "−0e-5")])
def test_figures_have_a_true_minus_sign_that_a_zero_never_has_and_names_keep_their_hyphens(
        words: str, shown: str) -> None:
    assert typeset(words) == shown


def test_options_and_ranges_break_nowhere_and_are_copied_as_they_are() -> None:
    assert sentence("more (--trials, 0.13–0.29)") == \
        "more (<span class=whole>--trials</span>, <span class=whole>0.13–0.29</span>)"
    assert command(["sva-bench", "run", "a b.yaml"]).count("<span class=whole>") == 3
    assert html.unescape(re.sub("<[^>]*>", "", command(["run", "a b.yaml"]))) == "run 'a b.yaml'"


def test_columns_of_nothing_but_nothing_are_left_out() -> None:
    assert difference(-0.04) == difference(0.0) == NOTHING
    assert (difference(1.25), difference(-3.0)) == ("+1.2", "-3.0")
    assert told_columns(["a", "b", "c", "d"], [["1", NOTHING, "", NOTHING], ["2", "", "", "3"]], (0, 2)) == (
        ["a", "c", "d"], [["1", "", NOTHING], ["2", "", "3"]])


def test_no_line_of_a_grid_strikes_through_a_label() -> None:
    drawn = rows_chart("title", "unit", [
        Row(label="long " * 8, told="mean 1, worst tenth 0", marks=[Dot(at=float(k), said="")])
        for k in range(3)], zero=True)
    labels = [float(y) for y in re.findall(r'<text (?:class=told )?x="[^"]*" y="([^"]+)"', drawn)]
    lines = [(float(y), float(y) + float(tall)) for y, tall in re.findall(
        r'<path class="(?:grid|zero)" d="M[0-9.]+ ([0-9.]+)v([0-9.]+)"', drawn)]
    assert len(labels) == 6  # of each row its label, and below what it comes to
    assert lines
    assert not any(top < y - 3 and y - 9 < bottom for y in labels for top, bottom in lines)


def test_panels_share_their_axes_and_say_how_many_are_left_out() -> None:
    shown = [Panel(title=f"S{k}", points=[Point(x=0.0, y=float(k), said="a"), Point(x=1.0, y=50.0, said="b")])
             for k in range(MOST_PANELS + 2)]
    drawn = panels("told", Axes(x="key", joined=True), shown, "Caption.")
    assert drawn.count("<svg class=panel") == MOST_PANELS
    assert f"The first {MOST_PANELS} of {MOST_PANELS + 2}." in drawn
    # The second point is the same of all, so it lies at one height in all.
    assert len(set(re.findall(r"<title>b</title><circle[^>]*cy=\"([^\"]+)\"", drawn))) == 1
    own = panels("told", Axes(x="key", apart=True), shown, "Caption.")
    assert len(set(re.findall(r"<title>b</title><circle[^>]*cy=\"([^\"]+)\"", own))) == 1  # its own greatest, each time
    assert len(set(re.findall(r"<title>a</title><circle[^>]*cy=\"([^\"]+)\"", own))) == 1
    assert len(set(re.findall(r"<title>a</title><circle[^>]*cy=\"([^\"]+)\"", drawn))) == MOST_PANELS
    assert panels("told", Axes(x="key"), [], "Caption.") == ""


@pytest.mark.parametrize("most", [1.0, 900.0, -4000.0, 2.5e5, -3.2e9, 1.5e-7])
def test_no_figure_beside_a_panel_is_cut(most: float) -> None:
    drawn = panels("told", Axes(x="key"), [Panel(title="S", points=[
        Point(x=0.0, y=0.0, said="a"), Point(x=1.0, y=most, said="b")])], "Caption.")
    figures = re.findall(r'<text class="tick left" x="([^"]+)"[^>]*>([^<]+)</text>', drawn)
    assert len(figures) > 1
    for right, figure in figures:
        signs = figure.count("\u2212")  # 9.2 wide in DejaVu Sans at 11 px, digits 7.0; half a unit is rounded off
        assert float(right) - 7.0 * (len(figure) - signs) - 9.2 * signs >= -0.5


def test_a_long_table_breaks_between_its_sections_in_print() -> None:
    rows = [[str(k)] for k in range(9)]
    assert table(["k"], rows, sections=[*"aaa", *"bbb", *"ccc"]).count("<tbody>") == 3
    assert "class=few" not in table(["k"], rows, sections=[*"aaa", *"bbb", *"ccc"])
    assert table(["k"], rows).count("<tbody>") == 1
    assert "class=few" in table(["k"], rows)
    assert "class=few" in table(["k"], rows[:4], sections="aabb")


def test_a_table_scrolls_in_a_box_that_shows_where_it_goes_on() -> None:
    assert table(["a"], [["1"]]).startswith("<div class=wide tabindex=0>")  # by keyboard too
    assert ".wide{overflow-x:auto" in STYLE
    assert "background-attachment:local,local,scroll,scroll" in STYLE


def test_what_is_folded_shows_its_heading() -> None:
    assert folded([]) == []
    assert folded([heading("Over"), "<p>inner</p>"]) == [
        '<details><summary><h2 id="over">Over</h2></summary><p>inner</p></details>']
    assert details("line", "inner", opened=True).startswith("<details open>")


def test_few_values_are_dots_by_their_frequency_and_many_are_a_distribution() -> None:
    few = _of_trials([(1.0, 25), (2.0, 75)], "red", 0.1)
    assert [mark.at for mark in few if isinstance(mark, Dot)] == [1.0, 2.0]
    # Areas are as the shares: three times as many, three times the area.
    assert [mark.radius ** 2 for mark in few if isinstance(mark, Dot)] == pytest.approx([16.0, 48.0])
    assert [mark.below for mark in few if isinstance(mark, Dot)] == ["25 %", "75 %"]
    (many,) = _of_trials([(float(k), 1) for k in range(MOST_DOTS + 1)], "red", 0.1)
    assert isinstance(many, Steps)
    assert list(many.shares) == pytest.approx([(k + 1) / (MOST_DOTS + 1) for k in range(MOST_DOTS + 1)])
    (most,) = _of_trials([(float(k), 1) for k in range(5000)], "red", 0.1)
    assert isinstance(most, Steps)
    assert len(most.values) <= 242
    assert (most.values[-1], most.shares[-1]) == (4999.0, 1.0)


@pytest.mark.parametrize("figures", [(0.0,), (1e15, -1e15), (1e-300, 0.0), (1e15, 1e15 + 0.125), (5.0, 5.0)])
def test_a_chart_holds_with_every_figure(figures: tuple[float, ...]) -> None:
    rows = [Row(label="a", marks=[Dot(at=figure, said=""), Span(low=min(figures), high=max(figures), said="")])
            for figure in figures]
    drawn = rows_chart("title", "unit", rows)
    places = [float(x) for x in re.findall(r'cx="([^"]+)"', drawn)]
    assert all(0 <= x <= 356 for x in places)
    assert "nan" not in drawn
    assert "inf" not in drawn


@pytest.mark.parametrize(("low", "high", "ticks"), [
    (-1.0, 10.5, [0, 2, 4, 6, 8, 10]), (0.01, 0.05, [0.01, 0.02, 0.03, 0.04, 0.05]), (990, 1130, [1000, 1050, 1100])])
def test_ticks_are_round_numbers(low: float, high: float, ticks: list[float]) -> None:
    assert round_ticks(low, high) == pytest.approx(ticks)
