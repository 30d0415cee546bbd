"""The pages of ``docs/`` as a site: built without a warning, all of them found, nothing loaded from elsewhere."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built as ``make docs`` does."""
    folder = tmp_path_factory.mktemp("site")
    began = time.monotonic()
    done = subprocess.run([sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)],
                          cwd=ROOT, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"}, text=True, capture_output=True,
                          timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert not done.stdout + done.stderr
    assert time.monotonic() - began < 60
    return folder


def test_every_page_is_there_and_stands_in_the_navigation(site: Path) -> None:
    index = (site / "index.html").read_text(encoding="utf-8")
    pages = [path.stem for path in sorted((ROOT / "docs").glob("*.md"))]
    assert len(pages) >= 30
    for page in pages:
        assert (site / f"{page}.html").is_file()
        assert f'href="{page}.html"' in index


def test_pages_load_nothing_from_elsewhere(site: Path) -> None:
    for page in site.glob("*.html"):
        loaded = re.findall(r'<(?:script|img|iframe)[^>]+src="([^"]+)|<link[^>]+href="([^"]+)',
                            page.read_text(encoding="utf-8"))
        assert len(loaded) >= 3
        for source in loaded:
            assert not re.match(r"(\w+:)?//", "".join(source)), f"{page.name}: {source}"


def test_pages_follow_the_readers_choice_of_light_or_dark(site: Path) -> None:
    index = (site / "index.html").read_text(encoding="utf-8")
    assert 'data-md-color-media="(prefers-color-scheme: dark)" data-md-color-scheme="slate"' in index


def test_a_link_that_leads_nowhere_is_an_error(tmp_path: Path) -> None:
    # Else --strict would promise more than it keeps.
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "index.md").write_text("[there](index.md#nowhere)\n", encoding="utf-8")
    settings = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    (tmp_path / "mkdocs.yml").write_text(settings[: settings.index("nav:\n")], encoding="utf-8")
    done = subprocess.run([sys.executable, "-m", "mkdocs", "build", "--strict"], cwd=tmp_path, text=True,
                          capture_output=True, timeout=300, check=False)
    assert done.returncode != 0
    assert "#nowhere" in done.stderr


def test_terms_of_the_glossary_are_in_order_and_each_there_once() -> None:
    terms = re.findall(r"^\*\*([^*]+)\*\*", (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert len(terms) >= 40
    assert terms == sorted(set(terms), key=str.lower)
    assert {"Fuel", "Rollout", "Twin", "Promised", "Expected", "Executed", "VSS", "EVPI", "News", "Calibration",
            "Interplay", "Anticipation"} <= set(terms)
