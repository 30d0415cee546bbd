"""What is said of values that were probably meant otherwise: shares in per cent, lists of another length, choices."""

from __future__ import annotations

from pathlib import Path

import pytest

from sva_bench.__main__ import run_command_line
from sva_bench.errors import BadFile
from sva_bench.world.load import load_world
from tests.worlds_for_tests import SMALL


def told(text: str, folder: Path) -> str:
    """The error of a world."""
    path = folder / "w.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BadFile) as error:
        load_world(path)
    return str(error.value)


@pytest.mark.parametrize(("old", "new", "key"), [
    ("half: {uv2: 0.5}", "half: {uv2: %s}", "scenarios.half.uv2"),
    ("scenarios:\n", "scenarios:\n  joint: {joint: [{probability: %s, available: [uv1]}]}\n",
     "scenarios.joint.joint[0].probability"),
    ("robots:\n", "margin: %s\nrobots:\n", "margin"),
    ("noise: {wheel_gain_sd: 0.01}", "noise: {wheel_gain_sd: %s}", "noise.wheel_gain_sd"),
    ("noise: {wheel_gain_sd: 0.01}", "noise: {capacity_sd: %s}", "noise.capacity_sd"),
    ("robots:\n", "passages: {d: {at_m: [[1, 1], [2, 2]], blocked: %s, wait_s: 1}}\nrobots:\n", "passages.d.blocked"),
])
def test_a_share_in_per_cent_is_answered_with_the_share(old: str, new: str, key: str, tmp_path: Path) -> None:
    assert old in SMALL
    for given, meant in (("15", "a share, not per cent; did you mean 0.15?"), ("15%", "write a share, 0.15")):
        said = told(SMALL.replace(old, new % given), tmp_path)
        assert key in said
        assert said.endswith(meant)
    assert "did you mean" not in told(SMALL.replace(old, new % "1500"), tmp_path)


def test_what_has_a_unit_is_no_share(tmp_path: Path) -> None:
    said = told(SMALL.replace("{wheel_gain_sd: 0.01}", "{localisation: {sd_m: 5, length_m: 30}}"), tmp_path)
    assert said.endswith("expected at most 1.0, found 5")


@pytest.mark.parametrize(("shape", "said"), [
    ("{wall: [[1, 1], [2, 2], [3, 3]]}", "[[x1, y1], [x2, y2]] (a wall that bends is several), found 3 entries"),
    ("{wall: [1, 1, 2, 2]}", "expected two points [[x1, y1], [x2, y2]]"),
    ("{box: [1, 1, 2], size_m: [1, 1]}", "expected a point [x, y], found 3 entries"),
    ("{box: [1, 1], size_m: 2}", "expected two lengths [along x, along y], found 2"),
    ("{cylinder: 3, radius_m: 1}", "expected a point [x, y], found 3"),
])
def test_a_list_of_another_length_is_answered_with_what_it_holds(shape: str, said: str, tmp_path: Path) -> None:
    text = SMALL.replace("{cylinder: [4.4, 3.2], radius_m: 0.3}", shape)
    assert shape in text
    assert said in told(text, tmp_path)


@pytest.mark.parametrize(("words", "said"), [
    (["export", "p.json", "--world", "w.yaml", "--to", "navv2"], "did you mean 'nav2'?"),
    (["run", "w.yaml", "--fidelity", "rolout"], "did you mean 'rollout'?"),
    (["run", "w.yaml", "--interaction", "Shared"], "did you mean 'shared'?"),
    (["run", "w.yaml", "--plan-failure", "hazzard"], "did you mean 'hazard'?"),
    (["plan", "w.yaml", "-o", "p.json", "--method", "branch-price"], "did you mean 'branch-and-price'?"),
    (["world", "random", "-o", "w.yaml", "--family", "mase"], "did you mean 'maze'?"),
    (["run", "w.yaml", "--margin", "5"], "did you mean 0.05?"),
    (["plan", "w.yaml", "-o", "p.json", "--beta", "95%"], "write a share, 0.95"),
    (["run", "w.yaml", "--calibrate", "bst"], "did you mean 'best'?"),
    (["run", "w.yaml", "--calibrate", "0.01"], "did you mean 1%?"),
    (["run", "w.yaml", "--precision", "5"], "did you mean 5%?"),
])
def test_a_mistyped_value_of_an_option_is_answered_with_the_nearest(
    words: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "w.yaml").write_text(SMALL, encoding="utf-8")
    assert run_command_line(words) == 2
    assert said in capsys.readouterr().err


def test_a_word_like_none_of_the_choices_gets_no_hint(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command_line(["run", "w.yaml", "--fidelity", "xyzzy"]) == 2
    said = capsys.readouterr().err
    assert "is not one of 'kinematic', 'rollout', 'physics'." in said
    assert "did you mean" not in said
