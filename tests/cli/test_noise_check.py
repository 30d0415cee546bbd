"""``world check --noise``: what noise leaves of the margins of a world's plans."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sva_bench.__main__ import run_command_line
from sva_bench.analysis.tightness import MarginQuantiles
from sva_bench.cli.noise_check import _JUDGED, _left
from sva_bench.report.styles import JUDGED_TOLD
from tests.worlds_for_tests import SMALL

DOOR = Path(__file__).parents[2] / "examples" / "one-door.yaml"


def test_legs_are_told_as_json_and_the_same_again(capsys: pytest.CaptureFixture[str]) -> None:
    told = []
    for _ in range(2):
        assert run_command_line(["world", "check", "--noise", str(DOOR), "--draws", "60", "--json"]) == 0
        told.append(capsys.readouterr().out)
    assert told[0] == told[1]
    found = json.loads(told[0])
    assert (found["format"], found["draws"], found["seed"]) == ("sva-bench/noise-check@1", 60, 0)
    (plan,) = found["plans"]
    assert plan["scenarios"] == ["nominal"]
    assert 0 < plan["bad"] < 1
    for leg in plan["legs"]:
        assert leg["driven_s"]["q05"] <= leg["driven_s"]["q50"] <= leg["driven_s"]["q95"]
        assert leg["fuel_margin_s"]["q01"] <= leg["fuel_margin_s"]["q05"]
        # What one draw in a hundred falls short of is below zero where more than that run dry or late.
        assert (leg["dry"] > 0.01) == (leg["fuel_margin_s"]["q01"] < 0)
        assert (leg["judged"] == "edge") == (max(leg["dry"], leg["late"], leg["stuck"]) > 0.01)
    assert plan["bad"] >= max(max(leg["dry"], leg["late"]) for leg in plan["legs"])


def test_a_table_with_the_worst_legs_first_and_a_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "margins.png"
    assert run_command_line(["world", "check", "--noise", str(DOOR), "--draws", "40", "-o", str(picture)]) == 0
    out = capsys.readouterr().out
    rows = [line for line in out.splitlines() if " to " in line and line.startswith(("uv", "  "))]
    edge = ["knife's edge" in row for row in rows]
    assert edge == sorted(edge, reverse=True)
    assert any(edge)
    assert "some robot runs dry, is late or gets stuck in" in out
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_given_plan_is_checked_in_place_of_ours(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan = tmp_path / "mine.json"
    plan.write_text(json.dumps({"format": "sva-bench/plan@1", "routes": {"uv1": ["base", "p1", "base"]}}))
    assert run_command_line(["world", "check", "--noise", str(DOOR), "--plan", str(plan), "--draws", "20",
                             "--json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)["plans"]
    assert found["plan"] == "mine"
    assert [(leg["origin"], leg["destination"], leg["judged"]) for leg in found["legs"]] == [
        ("base", "p1", "safe"), ("p1", "base", "safe")]


WHOLE, NARROW, ASIDE = "[[3.0, 2.6], [3.0, 6.0]]", "[[3.0, 2.6], [3.0, 2.9]]", "[[5.6, 2.8], [6.0, 2.8]]"
"""The gap in the wall of the small world; a part narrower than a robot; a corner where no path leads."""


@pytest.mark.parametrize(("at", "said"), [
    (WHOLE, None), (NARROW, "passage d1 is 0.3 m wide, and the narrowest robot 0.354 m"),
    (ASIDE, "no planned path crosses passage d1")])
@pytest.mark.parametrize("options", [[], ["--noise", "--draws", "2"]])
def test_a_passage_that_makes_no_difference_is_warned_of_once(
    at: str, said: str | None, options: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    world = tmp_path / "gap.yaml"
    world.write_text(f"{SMALL}passages:\n  d1: {{at_m: {at}, blocked: 0.5, wait_s: 1}}\n")
    assert run_command_line(["world", "check", str(world), *options]) == 0
    found = [line for line in capsys.readouterr().err.splitlines() if line.startswith("WARNING")]
    assert len(found) == (said is not None)
    assert all(str(said) in message for message in found)


@pytest.mark.parametrize(("payload_kg", "warned"), [(12.6, False), (12.7, True), (1e5, True)])
def test_a_payload_that_no_motor_of_the_robot_accelerates_is_warned_of(
    payload_kg: float, warned: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # A turtlebot2 weighs 6.3 kg, and its motors are three times as strong as it needs by itself.
    world = tmp_path / "laden.yaml"
    world.write_text(SMALL.replace("wheel_gain_sd: 0.01", f"payload_kg: [0, {payload_kg}]"))
    assert run_command_line(["world", "check", str(world)]) == 0
    found = [line for line in capsys.readouterr().err.splitlines() if line.startswith("WARNING")]
    assert len(found) == warned
    assert all("on turtlebot2, which weighs 6.3 kg itself: its motors bear 12.6 kg more" in line for line in found)


def test_terminal_picture_and_pages_call_a_judgement_by_one_word() -> None:
    contact, formats = ((DOOR.parents[1] / "docs" / f"{page}.md").read_text(encoding="utf-8")
                        for page in ("contact", "formats"))
    for judged, word in _JUDGED.items():
        assert judged == "safe" or (word and word in JUDGED_TOLD[judged] and f"*{word}*" in contact)
        assert word in formats.split("`judged` (")[1].split("; see")[0].split(f"`{judged}`")[1].split(";")[0]
    assert "*close*" not in contact


@pytest.mark.parametrize(("left_s", "said"), [
    (-0.0, "0.0"), (-0.04, "0.0"), (0.04, "0.0"), (-0.06, "-0.1"), (-1.25, "-1.2"), (None, "–")])
def test_a_margin_is_never_a_negative_zero(left_s: float | None, said: str) -> None:
    assert _left(MarginQuantiles(q01=left_s, q05=left_s)) == f"{said} {said}"


@pytest.mark.parametrize(("options", "said"), [
    (["--noise"], "has no noise"), (["--draws", "5"], "--draws belongs to --noise"),
    (["--json"], "--json belongs to --noise"), (["--noise", "-o", "margins.pdf"], "PNG or SVG")])
def test_what_makes_no_sense_is_one_error(options: list[str], said: str, tmp_path: Path,
                                          capsys: pytest.CaptureFixture[str]) -> None:
    quiet = tmp_path / "quiet.yaml"
    quiet.write_text(SMALL.replace("noise: {wheel_gain_sd: 0.01}", ""))
    assert run_command_line(["world", "check", str(quiet), *options]) == 2
    message = capsys.readouterr().err
    assert said in message
    assert message.count("error:") == 1
