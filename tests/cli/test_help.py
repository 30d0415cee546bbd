"""The pages of ``--help``: each has an example that parses, options in groups, and fits 80 columns without a cut."""

from __future__ import annotations

import os
import resource
import shlex
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest
import typer
from rich.cells import cell_len

from sva_bench import __version__
from sva_bench.__main__ import run_command_line
from sva_bench.cli import help_pages
from sva_bench.cli.app import app

PROGRAM = typer.main.get_command(app)


def pages(command: Any = PROGRAM, words: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """The words of every command and group; ``batch over`` is ``batch``."""
    if words[-1:] != ("over",):
        yield words
    for name, below in getattr(command, "commands", {}).items():
        yield from pages(below, (*words, name))


PAGES = list(pages())


def page(words: tuple[str, ...], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setenv("COLUMNS", "80")
    assert run_command_line([*words, "--help"]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("words", PAGES, ids=[" ".join(words) or "sva-bench" for words in PAGES])
def test_every_page_has_an_example_of_its_command_and_fits_eighty_columns(
    words: tuple[str, ...], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = page(words, capsys, monkeypatch)
    assert [line for line in shown.splitlines() if cell_len(line) > 80] == []
    assert "…" not in shown
    examples = [line.strip() for line in shown.splitlines() if line.strip().startswith("sva-bench ")]
    assert examples
    assert any(line.startswith(" ".join(["sva-bench", *words])) for line in examples)


@pytest.mark.parametrize("line", sorted({line for lines in help_pages.EXAMPLES.values() for line in lines}))
def test_every_example_parses(line: str) -> None:
    program, *arguments = shlex.split(line)
    assert program == "sva-bench"
    if arguments[-1] == "--help":
        return
    command: Any = PROGRAM
    with command.make_context("sva-bench", arguments) as context:  # raises where an option or argument is unknown
        while hasattr(command, "commands"):
            name, command, arguments = command.resolve_command(context, [*context._protected_args, *context.args])
            context = command.make_context(name, arguments, parent=context)
        assert not context.args


def test_examples_are_of_commands_that_there_are() -> None:
    assert set(help_pages.EXAMPLES) == {" ".join(words) for words in PAGES}


@pytest.mark.parametrize("words", [("run",), ("execute",), ("batch",)])
def test_many_options_stand_in_groups(
    words: tuple[str, ...], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = page(words, capsys, monkeypatch)
    groups = [line.split("─ ")[1].split(" ─")[0] for line in shown.splitlines() if line.startswith("╭─ ")]
    assert groups[0] == "Arguments"
    assert {"What is measured", "Plans", "Failures, news and other robots", "Running", "Output"} <= set(groups)
    assert "Worker processes." in shown


def test_groups_name_options_that_there_are() -> None:
    def names(command: Any) -> Iterator[str]:
        for below in getattr(command, "commands", {}).values():
            yield from names(below)
        yield from (parameter.name for parameter in command.params)

    assert set(help_pages._OF) <= set(names(PROGRAM))


def test_the_version_is_printed_alone(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command_line(["--version"]) == 0
    assert capsys.readouterr().out == f"sva-bench {__version__}\n"


AS_INSTALLED = "import sys; sys.argv[0] = 'sva-bench'; from sva_bench.__main__ import main; main()"


def completed(typed: str) -> set[str]:
    """What a shell is offered behind what is typed."""
    words = shlex.split(typed) + ([""] if typed.endswith(" ") else [])
    done = subprocess.run(
        [sys.executable, "-c", AS_INSTALLED], capture_output=True, text=True, check=False,
        env=os.environ | {"_SVA_BENCH_COMPLETE": "complete_bash", "COMP_WORDS": typed,
                          "COMP_CWORD": str(len(words) - 1)})
    return set(done.stdout.split())


@pytest.mark.parametrize(("typed", "offered"), [
    ("sva-bench ver", {"verify"}), ("sva-bench world dr", {"draw"}), ("sva-bench run --fid", {"--fidelity"}),
    ("sva-bench run --fidelity k", {"kinematic"}), ("sva-bench batch --comp", {"--compare"}),
])
def test_a_shell_completes_commands_options_and_choices(typed: str, offered: set[str]) -> None:
    assert completed(typed) == offered


def test_a_script_for_the_shell_is_printed() -> None:
    done = subprocess.run(
        [sys.executable, "-c", AS_INSTALLED, "--show-completion", "bash"], capture_output=True, text=True, check=True,
        env=os.environ | {"_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"})
    assert "_SVA_BENCH_COMPLETE=complete_bash" in done.stdout


def least_s(*words: str) -> float:
    """Processor time of a command [s]: others that use the processor make it longer, so the least of some counts."""
    times = []
    for _ in range(5):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([sys.executable, *words], capture_output=True, check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        times.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return min(times)


@pytest.mark.long
def test_help_takes_at_most_three_times_that_of_the_library_that_prints_it() -> None:
    assert least_s("-m", "sva_bench", "batch", "--help") < 3 * least_s("-m", "typer", "--help")  # 2.3 measured


def test_help_loads_nothing_that_it_needs_not() -> None:
    heavy = {"numpy", "numba", "pydantic", "ruamel.yaml", "matplotlib", "pandas", "pyarrow"}
    code = f"import sys, sva_bench.cli.app; print(sorted({heavy!r} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
