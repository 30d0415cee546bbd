"""What a user types, and types wrongly: usage lines, files of another kind, worlds that were edited by hand."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from sva_bench import seeds
from sva_bench.__main__ import run_command_line
from sva_bench.cli.app import app
from sva_bench.files.seal import refuse_others, sealed
from sva_bench.study import bounds
from tests.cli.test_commands import TINY
from tests.worlds_for_tests import SMALL

ROS_MAP = "image: map.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
OCTILE_MAP = "type octile\nheight 3\nwidth 3\nmap\n...\n...\n...\n"
PLAN = '{"format": "sva-bench/plan@1", "routes": {}}'
SWEEP = "format: sva-bench/sweep@1\nworlds: [small.yaml]\n"


@pytest.mark.parametrize(("command", "usage"), [
    (("run",), "run [OPTIONS] WORLD"), (("execute",), "execute [OPTIONS] WORLD PLAN..."),
    (("plan",), "plan [OPTIONS] WORLD-or-INSTANCE"), (("certify",), "certify [OPTIONS] INSTANCE PLAN"),
    (("batch",), "batch [OPTIONS] WORLD..."), (("batch", "status"), "batch status [OPTIONS] DIR"),
    (("batch", "retry"), "batch retry [OPTIONS] DIR"), (("report",), "report [OPTIONS] RUN"),
    (("replay",), "replay [OPTIONS] RUN"),
    (("reproduce",), "reproduce [OPTIONS] PART [ARGS]..."),
    (("reproduce", "simulation"), "reproduce simulation [OPTIONS] [WORLD...]"),
    (("reproduce", "reaction"), "reproduce reaction [OPTIONS] [WORLD...]"),
    (("view",), "view [OPTIONS] RUN-or-RRD"),
    (("world",), "world [OPTIONS] COMMAND [ARGS]..."), (("world", "draw"), "world draw [OPTIONS] WORLD"),
    (("world", "from-map"), "world from-map [OPTIONS] MAP.yaml|MAP.map"),
    (("world", "example"), "world example [OPTIONS] [NAME]"),
])
def test_a_usage_line_is_what_is_typed(
    command: tuple[str, ...], usage: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command_line([*command, "--help"]) == 0
    shown = [line.strip() for line in capsys.readouterr().out.splitlines() if "Usage:" in line]
    assert len(shown) == 1
    assert shown[0].endswith(f" {usage}")


def test_an_unknown_option_of_a_batch_is_answered_in_the_users_words(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command_line(["batch", "--nonesuch"]) == 2
    said = capsys.readouterr().err
    assert "batch [OPTIONS] WORLD..." in said
    assert "batch --help" in said
    assert "over" not in said


@pytest.mark.parametrize(("command", "name", "text", "said"), [
    (("run",), "map.yaml", ROS_MAP, "sva-bench world from-map"),
    (("run",), "rooms.map", OCTILE_MAP, "sva-bench world from-map"),
    (("world", "check"), "map.yaml", ROS_MAP, "sva-bench world from-map"),
    (("plan",), "map.yaml", ROS_MAP, "sva-bench world from-map"),
    (("plan",), "rooms.map", OCTILE_MAP, "sva-bench world from-map"),
    (("batch", "--dry-run"), "map.yaml", ROS_MAP, "sva-bench world from-map"),
    (("batch", "--dry-run"), "rooms.map", OCTILE_MAP, "sva-bench world from-map"),
    (("run",), "i.json", TINY, "this is an instance: `sva-bench plan`"),
    (("run",), "p.json", PLAN, "this is a plan: `sva-bench execute WORLD PLAN`"),
    (("run",), "sweep.yaml", SWEEP, "this is a sweep: `sva-bench batch`"),
    (("plan",), "p.json", PLAN, "this is a plan: `sva-bench execute WORLD PLAN`"),
    (("plan",), "sweep.yaml", SWEEP, "this is a sweep: `sva-bench batch`"),
    (("certify", "i.json"), "small.yaml", SMALL, "this is a world: `sva-bench run`"),
    (("certify", "i.json"), "i.json", TINY, "this is an instance: `sva-bench plan`"),
    (("world", "from-map", "-o", "w.yaml"), "small.yaml", SMALL, "this is a world: `sva-bench run`"),
    (("world", "from-map", "-o", "w.yaml"), "sweep.yaml", SWEEP, "this is a sweep: `sva-bench batch`"),
])
def test_a_file_of_another_kind_is_named_with_the_command_that_takes_it(
    command: tuple[str, ...], name: str, text: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "i.json").write_text(TINY)
    (tmp_path / name).write_text(text)
    assert run_command_line([*command, name]) == 2
    told = "".join(capsys.readouterr())
    assert told.startswith(f"error: {name}:")
    assert said in told
    assert told.count("\n") == 1


def test_an_old_version_of_the_right_kind_is_no_other_kind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "w.yaml").write_text(SMALL.replace("world@1", "world@0"))
    assert run_command_line(["run", "w.yaml"]) == 2
    assert capsys.readouterr().err == "error: w.yaml:1: format: expected 'sva-bench/world@1', found " \
                                      "'sva-bench/world@0'\n"


RANDOM = ("world", "random", "--size", "10", "--pois", "4", "--stations", "1", "-o", "w.yaml")


def test_a_world_that_was_edited_is_not_written_over_unless_that_is_wanted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "w.yaml"
    assert run_command_line(RANDOM) == 0
    first = path.read_text()
    assert run_command_line([*RANDOM, "--seed", "1"]) == 0  # nobody has touched it
    assert path.read_text() != first
    for edited in (first + "# mine\n", first.replace("margin: 0.01", "margin: 0.02"), SMALL):  # the last by hand
        assert edited != first
        path.write_text(edited)
        capsys.readouterr()
        assert run_command_line(RANDOM) == 2
        assert capsys.readouterr().err.startswith("error: w.yaml: this world was edited")
        assert path.read_text() == edited
    assert run_command_line([*RANDOM, "--force"]) == 0
    assert path.read_text() == first


@pytest.mark.parametrize("change", [lambda text: text.replace("\n", "\r\n"), lambda text: "\ufeff" + text])
def test_line_ends_and_byte_order_marks_are_no_edits(change: object, tmp_path: Path) -> None:
    from sva_bench.files.seal import refuse_edited

    assert callable(change)
    path = tmp_path / "w.yaml"
    path.write_bytes(change(sealed("# A head.\n" + SMALL)).encode())
    refuse_edited(path, force=False)


def test_other_files_are_written_over_as_ever(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "w.yaml").write_text("notes: of mine\n")
    assert run_command_line(RANDOM) == 0
    (tmp_path / "i.json").write_text(json.dumps({"format": "sva-bench/instance@1", "mine": True}))
    assert run_command_line(["instance", "random", "--pois", "3", "-o", "i.json"]) == 0


def test_the_map_of_a_world_of_another_ending_is_not_written_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    open_field = "type octile\nheight 6\nwidth 6\nmap\n" + "......\n" * 6
    (tmp_path / "a.map").write_text(open_field)
    other = tmp_path / "other"
    other.mkdir()
    (other / "a.map").write_text(open_field[:-2] + "@\n")
    command = ["world", "from-map", "--pois", "4", "--stations", "0", "--cell-m", "2"]
    assert run_command_line([*command, "a.map", "-o", "w.yaml"]) == 0
    assert run_command_line([*command, "other/a.map", "-o", "w.yml"]) == 2
    assert "w-map/a.map: this map belongs to another world" in capsys.readouterr().err
    assert (tmp_path / "w-map" / "a.map").read_text() == open_field
    refuse_others(tmp_path / "w.yaml", {"w-map/a.map": b"of a newer map"})  # its own may be renewed


def commands(group: Any = None, words: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Every command, and the words that call it."""
    group = group or typer.main.get_command(app)
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands(command, (*words, name))
        else:
            yield (*words, name), command


OPTIONS = [(words, parameter) for words, command in commands() for parameter in command.params
           if parameter.param_type_name == "option" and not parameter.is_flag and parameter.name != "help"]


@pytest.mark.spread(40)
@pytest.mark.parametrize(("words", "option"), [(words, max(p.opts, key=len)) for words, p in OPTIONS])
def test_an_empty_value_is_refused_by_the_name_of_its_option(
    words: tuple[str, ...], option: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    values = ["", ""] if option == "--base" else [""]
    assert run_command_line([*words, "x.yaml", option, *values]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"error: {option}: its value is empty"), said
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("words", [words for words, command in commands() if any(
    parameter.param_type_name == "argument" for parameter in command.params)], ids=" ".join)
def test_an_empty_argument_is_refused(words: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command_line([*words, "", ""]) == 2
    assert "its value is empty" in capsys.readouterr().err or words in (
        ("view",), ("report",), ("replay",), ("verify",))


SEEDED = [words for words, parameter in OPTIONS if parameter.name == "seed"]


def test_every_command_that_draws_takes_a_seed() -> None:
    assert {" ".join(words) for words in SEEDED} == {
        "run", "execute", "reproduce simulation", "reproduce reaction",
        "batch over", "world random", "world from-map", "world check", "instance random"}
    assert bounds.MOST_SEED == seeds.MOST_SEED


@pytest.mark.parametrize("words", SEEDED, ids=" ".join)
def test_a_seed_beyond_64_bits_is_refused_by_option_with_the_bound(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    arguments = {"reproduce": ["rewards"], "instance random": [], "world random": [], "execute": ["w.yaml", "p.json"],
                 "world from-map": ["m.map", "-o", "w.yaml"]}.get(" ".join(words), ["w.yaml"])
    assert run_command_line([*words, *arguments, "--seed", str(2**63)]) == 2
    said = capsys.readouterr().err
    assert "--seed" in said
    assert str(2**63 - 1) in said, said
