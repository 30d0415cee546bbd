"""Robots, plans and sites have one colour each, everywhere, which colour-blind readers tell apart."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

import sva_bench
from sva_bench import palette
from sva_bench.arrays import FloatArray
from sva_bench.palette import PLANS, ROBOTS, SITES, Color, hex_of, plan_color, robot_color
from sva_bench.recording.colors import ROBOT_COLORS, SITE_COLORS
from sva_bench.report import styles
from sva_bench.report.page_style import DARK, LIGHT

PACKAGE = Path(sva_bench.__file__).parent

# Source: Machado, Oliveira & Fernandes (2009), A physiologically-based model for simulation of color vision
# deficiency, severity 1; on linear red, green and blue.
SEEN_BY: dict[str, FloatArray] = {
    "all cones": np.eye(3),
    "protanopes": np.array([[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
                            [-0.003882, -0.048116, 1.051998]]),
    "deuteranopes": np.array([[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                              [-0.011820, 0.042940, 0.968881]]),
    "tritanopes": np.array([[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
                            [0.004733, 0.691367, 0.303900]])}


def linear(color: Color) -> FloatArray:
    share = np.array(color) / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def contrast(one: Color, other: Color) -> float:
    """The contrast ratio of two colours, as the Web Content Accessibility Guidelines 2.2 have it."""
    low, high = sorted(float(linear(color) @ [0.2126, 0.7152, 0.0722]) for color in (one, other))
    return (high + 0.05) / (low + 0.05)


def lab(rgb: FloatArray) -> FloatArray:
    """CIE L*a*b* of linear red, green and blue."""
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]) @ np.clip(
        rgb, 0, 1) / (0.9505, 1.0, 1.089)
    f = np.where(xyz > 0.008856, np.cbrt(np.maximum(xyz, 1e-9)), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def rgb_of(code: str) -> Color:
    return int(code[1:3], 16), int(code[3:5], 16), int(code[5:7], 16)


@pytest.mark.parametrize("reader", SEEN_BY)
@pytest.mark.parametrize("colors", [ROBOTS, tuple(PLANS.values()), tuple(SITES.values())],
                         ids=["robots", "plans", "sites"])
def test_colour_blind_readers_tell_colours_apart(colors: Sequence[Color], reader: str) -> None:
    for one, other in combinations(colors, 2):
        seen = [lab(SEEN_BY[reader] @ linear(color)) for color in (one, other)]
        # 2.3 is just noticed side by side; lines and dots lie apart, and are small.
        assert np.hypot.reduce(seen[0] - seen[1]) > 10, (one, other)


@pytest.mark.parametrize("mode", [LIGHT, DARK], ids=["light", "dark"])
def test_plans_are_seen_on_a_page_in_both_modes(mode: dict[str, str]) -> None:
    assert min(contrast(color, rgb_of(mode["paper"])) for color in PLANS.values()) >= 3


def test_no_robot_has_the_colour_of_a_plan() -> None:
    assert not set(ROBOTS) & set(PLANS.values())


def test_recordings_drawings_and_pages_have_the_colours_of_the_palette() -> None:
    assert ROBOT_COLORS == ROBOTS
    assert SITE_COLORS == SITES
    assert [colour for colour, _, _ in styles.ROBOTS] == [hex_of(color) for color in ROBOTS]
    assert {kind: colour for kind, (_, colour, _) in styles.SITE_MARKERS.items()} == {
        kind: hex_of(color) for kind, color in SITES.items()}
    for number in range(7):
        assert styles.robot_colour(number) == hex_of(robot_color(number)) == hex_of(ROBOTS[number % 5])


def test_a_plan_has_its_colour_wherever_it_stands_and_others_take_turns() -> None:
    assert plan_color("calibrated", 0) == plan_color("calibrated", 7) == PLANS["calibrated"]
    given = [plan_color(f"plan {number}", number) for number in range(5)]
    assert given == list(PLANS.values())


def test_nobody_but_the_palette_spells_a_colour_of_it() -> None:
    of_palette = {hex_of(color) for color in vars(palette).values() if isinstance(color, tuple) and len(color) == 3
                  and all(isinstance(channel, int) for channel in color)} | {hex_of(c) for c in PLANS.values()}
    for path in sorted([*(PACKAGE / "report").glob("*.py"), *(PACKAGE / "recording").glob("*.py")]):
        spelt = {code.lower() for code in re.findall(r"#[0-9A-Fa-f]{6}\b", path.read_text(encoding="utf-8"))}
        assert not spelt & of_palette - {"#000000"}, path.name  # black is ink too
