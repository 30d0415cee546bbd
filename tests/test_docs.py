"""What README and docs say can be typed can: their commands are run, and their Python."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import pytest

from sva_bench.__main__ import run_command_line
from sva_bench.recording.viewer import LAVAPIPE
from tests import reference, reference_commands, reference_keys
from tests.world.maps_for_tests import write_ros_map

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
PAGES = (README, *sorted((ROOT / "docs").glob("*.md")))
BIN = Path(sys.executable).parent

SHORT = "--trials 20 --rollouts 1 --fidelity kinematic --workers 1"
"""Put behind commands that drive: of an option that stands twice the later counts. Figures of pages are not checked by
these runs, but that their commands are right."""
NOT_RUN = {
    "make ": "sets up an environment, or is this very suite",
    ". .venv": "the environment is that of the tests",
    "docker ": "there is no engine here",
}
ELSEWHERE = {"here": "asks a cluster", "machines": "starts a cluster"}
"""Prompts of other machines; tests/batch runs batches by Dask on workers of its own."""
LONG = (
    "sva-bench view",  # a viewer
    "sva-bench batch worlds/", "sva-bench batch sweep.yaml", "sva-bench batch status",  # many worlds
    "sva-bench run worlds/four-rooms.yaml --interaction",  # four scenarios of 18 POIs, for each robot by itself
    "sva-bench run three-halls.yaml", "sva-bench certify runs/three-halls-",  # calibrates
)
"""Too long for every run of the suite: `make test-long` runs them."""
FIRST = ("README.md", "two-rooms.md")
"""Pages whose commands every run of the suite types; `make test-long` types those of all."""


class Typed(NamedTuple):
    """A command and the page that it stands on."""

    page: str
    command: str


def blocks(page: Path, language: str) -> list[str]:
    """The blocks of a language in a page."""
    found: list[str] = re.findall(rf"^```{language}\n(.*?)^```", page.read_text(encoding="utf-8"),
                                  re.MULTILINE | re.DOTALL)
    return found


def typed_on(page: Path) -> list[Typed]:
    """What is typed in the console blocks of a page, without comments, a prompt of another machine before it."""
    lines = [line for block in blocks(page, "console") for line in block.replace("\\\n", " ").splitlines()]
    found = [re.fullmatch(r"(\w*)\$ +(.*?)(\s+#\s.*)?", line) for line in lines]
    return [Typed(page.name, f"{match[1]}$ {match[2]}" if match[1] else match[2]) for match in found if match]


COMMANDS = [typed for page in PAGES for typed in typed_on(page)]
OURS = [typed for typed in COMMANDS if typed.command.startswith("sva-bench ")]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to type in: shipped worlds, plans and examples, a map, and the files that pages show."""
    for name in ("worlds", "plans", "examples"):
        shutil.copytree(ROOT / name, tmp_path / name)
    write_ros_map(tmp_path, "\n".join(["#" * 32, *["#" + "." * 14 + "#" + "." * 15 + "#"] * 8, "#" + "." * 30 + "#",
                                       "#" + "." * 30 + "#", *["#" + "." * 14 + "#" + "." * 15 + "#"] * 8, "#" * 32]))
    for page in PAGES:
        for block in blocks(page, "yaml"):
            if block.startswith("format: sva-bench/world@1"):
                (title,) = re.findall(r"^name: (\S+)$", block, re.MULTILINE)
                (tmp_path / f"{title}.yaml").write_text(block, encoding="utf-8")
            elif block.startswith("format: sva-bench/sweep@1"):
                (tmp_path / "sweep.yaml").write_text(block, encoding="utf-8")
        for block in blocks(page, "text"):
            if block.startswith("robot,stop,site\n"):
                (tmp_path / "mine.csv").write_text(block, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path


def as_run(command: str) -> str | None:
    """The command as the tests run it; ``None`` where it would open a window, or wants a driver."""
    words = command.split()
    if words[1] == "view" and ("--screenshot" not in words or not LAVAPIPE.exists()):
        return None
    takes_trials = words[1] in ("run", "execute") or (
        words[1] == "batch" and words[2] not in ("status", "retry") and "--dry-run" not in words)
    return f"{command} {SHORT}" if takes_trials else command


def words_of(command: str, folder: Path) -> list[str]:
    """The words that a shell makes of it."""
    split = subprocess.run(["bash", "-c", f"printf '%s\\0' {command}"], cwd=folder, capture_output=True, check=True)
    return [os.fsdecode(word) for word in split.stdout.split(b"\0")[:-1]]


def run_all(commands: list[Typed], folder: Path, capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Run each distinct command once, in the order of pages, and tell which went wrong."""
    wrong = []
    for page, command in {typed.command: typed for typed in commands}.values():
        if (told := as_run(command)) is None:
            continue
        code = run_command_line(words_of(told, folder)[1:])
        said = capsys.readouterr()
        if code:
            wrong.append(f"{page}: {told}\nexit code {code}\n{said.out}{said.err}")
    return wrong


def test_every_command_in_a_console_block_is_run_or_has_a_reason_not_to_be() -> None:
    assert len(OURS) >= 30
    for page, command in COMMANDS:
        prompt = command.partition("$ ")[0]
        assert command.startswith(("sva-bench ", *NOT_RUN)) or prompt in ELSEWHERE, (
            f"{page}: say in NOT_RUN or ELSEWHERE why this is not run: {command}")


@pytest.mark.parametrize("reason", [*NOT_RUN, *LONG])
def test_no_reason_not_to_run_a_command_has_outlived_it(reason: str) -> None:
    assert any(command.startswith(reason) for _, command in COMMANDS), reason


def test_what_the_pages_say_to_type_works(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    short = [typed for typed in OURS if typed.page in FIRST and not typed.command.startswith(LONG)]
    wrong = run_all(short, folder, capsys)
    assert not wrong, "\n".join(wrong)
    for page, block in PYTHON:
        if "import pandas" not in block or find_spec("pandas"):  # pandas is not installed by us
            exec(compile(block, page, "exec"), {})


@pytest.mark.long
def test_all_that_the_pages_say_to_type_works_batches_and_viewer_too(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = run_all(OURS, folder, capsys)
    assert not wrong, "\n".join(wrong)


@pytest.mark.long
@pytest.mark.parametrize("page", ["two-rooms", "ci"])
def test_what_commands_say_stands_on_the_page(page: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    # As they are typed there, so that figures are those of the page.
    said = ""
    for _, command in typed_on(ROOT / "docs" / f"{page}.md"):
        assert run_command_line(words_of(command, folder)[1:]) == 0, command
        said += capsys.readouterr().out
    shown = blocks(ROOT / "docs" / f"{page}.md", "text")
    assert shown
    for block in shown:
        for line in block.splitlines():
            assert line in said


def test_every_command_in_the_text_of_a_page_is_one() -> None:
    from sva_bench.cli.app import app

    known = {info.name or getattr(info.callback, "__name__", "") for info in app.registered_commands}
    known |= {info.name for info in app.registered_groups if info.name}
    for page in PAGES:
        for command in re.findall(r"`sva-bench ([a-z]+)", page.read_text(encoding="utf-8")):
            assert command in known, f"{page.name}: sva-bench {command}"


def test_make_help_lists_every_target_with_a_comment() -> None:
    said = subprocess.run(["make", "help"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    listed = dict(re.findall(r"^make ([a-z-]+) +(.+)$", said, re.MULTILINE))
    phony = re.findall(r"^\.PHONY: (.*)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert set(listed) == set(" ".join(phony).split())


def test_targets_of_make_that_are_named_are_there() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    named = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    targets = set(re.findall(r"(?:^\$ |`)make ([a-z-]+)", named, re.MULTILINE))
    assert {"run", "test", "lint", "docs"} <= targets
    for target in targets:
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


def test_files_of_the_repository_that_are_named_are_there() -> None:
    for page in PAGES:
        for path in re.findall(r"`((?:tests|benchmarks|examples|worlds)/[\w./-]+)`",
                               page.read_text(encoding="utf-8")):
            assert (ROOT / path).exists(), f"{page.name}: {path}"


def test_links_of_the_readme_lead_somewhere() -> None:
    links = re.findall(r"\]\(([^)#]+)", README.read_text(encoding="utf-8"))
    assert len(links) >= 20
    for link in links:
        assert (ROOT / link).exists(), link


def test_the_readme_is_one_page() -> None:
    assert README.read_text(encoding="utf-8").count("\n") <= 100


def test_a_world_that_stands_in_several_places_is_the_same_in_all() -> None:
    shown = {block for page in (README, ROOT / "docs" / "two-rooms.md") for block in blocks(page, "yaml")}
    assert shown == {(ROOT / "examples" / "two-rooms.yaml").read_text(encoding="utf-8")}


EXAMPLE = (ROOT / "examples" / "from_world_to_vss.py").read_text(encoding="utf-8")
ALL_PYTHON = [(page.name, block) for page in PAGES for block in blocks(page, "python")
              if not block.startswith("sb.")  # signatures of the reference
              and page.name not in ("extending.md", "recordings.md")]  # whose blocks tests of their own run
PYTHON = [entry for entry in ALL_PYTHON if entry[1] != EXAMPLE]  # which test_examples runs


def test_the_example_stands_in_the_page_of_python_as_it_is() -> None:
    assert [name for name, block in ALL_PYTHON if block == EXAMPLE] == ["api.md"]


@pytest.mark.parametrize(("name", "block"), PYTHON)
def test_python_of_a_page_is_python(name: str, block: str) -> None:
    compile(block, name, "exec")


@pytest.mark.parametrize(("page", "made", "by"), [
    ("api", reference.reference, "reference"), ("commands", reference_commands.page, "reference_commands"),
    ("keys", reference_keys.page, "reference_keys"),
])
def test_a_page_that_is_made_of_the_code_is_up_to_date(page: str, made: object, by: str) -> None:
    assert callable(made)
    assert (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8") == made(), \
        f"python -m tests.{by} > docs/{page}.md"
    assert f"`python -m tests.{by} > docs/{page}.md`" in (ROOT / "docs" / "development.md").read_text(encoding="utf-8")
