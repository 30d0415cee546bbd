"""The shipped worlds as commands give them."""

from __future__ import annotations

from pathlib import Path

import pytest

from sva_bench.__main__ import run_command_line
from sva_bench.errors import BadInput
from sva_bench.files.digest import digest
from sva_bench.generate import examples
from sva_bench.generate.examples import example_names, example_plans, example_world
from sva_bench.world.load import load_world

ROOT = Path(__file__).parents[2]


def test_every_shipped_world_is_an_example_and_every_plan_is_one_worlds() -> None:
    assert list(example_names()) == sorted(path.stem for path in (ROOT / "worlds").iterdir())
    plans = [path for name in example_names() for path in example_plans(name)]
    assert sorted(plans) == sorted((ROOT / "plans").iterdir())


def test_a_plan_belongs_to_the_world_with_the_longer_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shipped = {"worlds": ("maze.yaml", "maze-large.yaml"), "plans": ("maze-S2.json", "maze-large-S2.json")}
    for folder, names in shipped.items():
        (tmp_path / folder).mkdir()
        for name in names:
            (tmp_path / folder / name).touch()
    monkeypatch.setattr(examples, "_PLACES", (tmp_path,))
    assert [path.name for path in example_plans("maze")] == ["maze-S2.json"]
    assert [path.name for path in example_plans("maze-large")] == ["maze-large-S2.json"]


def test_what_is_installed_beside_the_code_comes_before_a_checkout(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Beside an installed package there may be somebody else's folder "worlds".
    for place in ("shipped", "site-packages"):
        (tmp_path / place / "worlds").mkdir(parents=True)
        (tmp_path / place / "worlds" / f"{place}.yaml").touch()
    monkeypatch.setattr(examples, "_PLACES", (tmp_path / "shipped", tmp_path / "site-packages"))
    assert example_names() == ("shipped",)
    monkeypatch.setattr(examples, "_PLACES", (tmp_path / "neither",))
    with pytest.raises(BadInput, match="install it again"):
        example_names()


@pytest.mark.spread(2)
@pytest.mark.parametrize("name", example_names())
def test_an_example_is_the_shipped_world_and_may_be_copied_again_until_it_is_edited(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    command = ["world", "example", name, "-o", "mine.yaml"]
    assert run_command_line(command) == 0
    told = capsys.readouterr()
    assert told.out == ""
    assert all(f"a plan for it: {path}" in told.err for path in example_plans(name))
    path = tmp_path / "mine.yaml"
    assert digest(load_world(path)) == digest(load_world(example_world(name)))
    assert run_command_line(command) == 0
    path.write_text(path.read_text() + "# mine\n")
    capsys.readouterr()
    assert run_command_line(command) == 2
    assert capsys.readouterr().err.startswith("error: mine.yaml: this world was edited")
    assert path.read_text().endswith("# mine\n")
    assert run_command_line([*command, "--force"]) == 0


def test_an_example_goes_to_standard_output_unless_a_file_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command_line(["world", "example", "maze"]) == 0
    assert "\nname: maze\n" in capsys.readouterr().out


@pytest.mark.parametrize(("arguments", "said"), [
    ((), "say which world: four-rooms, "), (("four-room",), "did you mean 'four-rooms'?"),
    (("../maze",), "did you mean 'maze'?"),
    (("maze", "--list"), "--list takes neither"), (("--list", "-o", "w.yaml"), "--list takes neither"),
    (("maze", "-o", "missing/w.yaml"), "there is no such folder"),
])
def test_a_mistaken_example_is_refused_with_what_to_type(
    arguments: tuple[str, ...], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_command_line(["world", "example", *arguments]) == 2
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
