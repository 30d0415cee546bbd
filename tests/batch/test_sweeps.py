"""Sweeps: from the command line, from a file, and what is wrong with either."""

from __future__ import annotations

import json
from pathlib import Path
from typing import get_args

import pytest

from sva_bench.__main__ import run_command_line
from sva_bench.batch.cache import Cache
from sva_bench.batch.estimates import estimates, total_s
from sva_bench.batch.folder import begin, settings_in
from sva_bench.batch.grid import grid_of as grid_from
from sva_bench.batch.sweep import Sweep, grid_of, planners_of, seeds_of, sweep_of, varied
from sva_bench.choices import INTERACTIONS, Interaction, News, PathPlanner, PolicyName
from sva_bench.errors import BadFile, BadInput
from sva_bench.files.records import as_dict
from tests.commands_for_tests import sva_bench
from tests.worlds_for_tests import SMALL

SWEEP = """\
format: sva-bench/sweep@1
worlds: ["*.world.yaml"]
seeds: 0-2
trials: 50
fidelity: kinematic
scenarios: [half]
planners: [prmstar]
set:
  robots.uv2.fuel_capacity_s: [50, 60]
"""


def world(folder: Path, name: str = "small") -> Path:
    path = folder / f"{name}.world.yaml"
    path.write_text(SMALL.replace("name: small", f"name: {name}"), encoding="utf-8")
    return path


def test_seeds_are_numbers_and_ranges() -> None:
    assert seeds_of(["3", "0-2", "7"]) == (3, 0, 1, 2, 7)
    assert seeds_of([str(2**63 - 1)]) == (2**63 - 1,)


@pytest.mark.parametrize("word", ["", "x", "-1", "5-3", "1-2-3", "0-999999999", "1.5"])
def test_what_is_no_seed_is_refused(word: str) -> None:
    with pytest.raises(BadInput, match="--seed"):
        seeds_of([word])


def test_values_are_those_of_a_world_file() -> None:
    assert varied(["a.b=1,2.5,per_leg", "c=[1, 2],[3, 4]", "d=null"]) == {
        "a.b": [1, 2.5, "per_leg"], "c": [[1, 2], [3, 4]], "d": [None]}


@pytest.mark.parametrize("word", ["a", "a=", "=1", "a=]", "a=1,*x"])
def test_what_sets_nothing_is_refused(word: str) -> None:
    with pytest.raises((BadInput, BadFile), match="--set"):
        varied([word])


def test_planners_are_known_ones() -> None:
    assert planners_of(["rrtconnect", "prmstar"]) == ("prmstar", "rrtconnect")
    with pytest.raises(BadInput, match="prmstar"):
        planners_of(["prm"])


@pytest.mark.parametrize("words", [["0,0"], ["0", "0"], ["3-5", "4"], ["1", "0-2,7"], [" 2", "2"]])
def test_a_duplicate_seed_is_refused(words: list[str]) -> None:
    with pytest.raises(BadInput, match=r"--seed .*: the seed \d is given twice; give each once"):
        seeds_of(words)


@pytest.mark.parametrize("word", [str(2**63), f"0,{2**63}", f"0-{2**63}", "9" * 40, "9" * 5000])
def test_a_seed_beyond_what_tables_hold_is_refused_with_the_bound(word: str) -> None:
    with pytest.raises(BadInput, match=r"--seed '\d.*a seed is 9223372036854775807 at most") as caught:
        seeds_of([word])
    assert len(str(caught.value)) < 200


@pytest.mark.parametrize(("line", "option"), [
    ("--seed 0 --seed 0", "--seed "), ("--planner prmstar --planner prmstar", "--planner prmstar"),
    ("--scenario half --scenario half", "--scenario half"), ("--set noise.wheel_gain_sd=0,0", "--set noise")])
def test_duplicates_are_errors_of_their_option(
    line: str, option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command_line(["batch", str(world(tmp_path)), *line.split(), "--dry-run"]) == 2
    assert capsys.readouterr().err.startswith(f"error: {option}")


@pytest.mark.parametrize("key", ["seeds: [1, 0-2]", "planners: [fmt, fmt]", "scenarios: [half, half]"])
def test_duplicates_in_a_sweep_file_are_errors_of_their_line(key: str, tmp_path: Path) -> None:
    path = tmp_path / "sweep.yaml"
    path.write_text(f"format: sva-bench/sweep@1\nworlds: [{world(tmp_path).name}]\n{key}\n", encoding="utf-8")
    with pytest.raises(BadFile, match=rf"sweep\.yaml:3: {key.split(':')[0]}.* (twice|is a duplicate)"):
        grid_of(sweep_of([path], Sweep()))


def test_a_sweep_file_is_the_same_as_its_options_and_options_come_first(tmp_path: Path) -> None:
    path = world(tmp_path)
    world(tmp_path, "other")
    (tmp_path / "sweep.yaml").write_text(SWEEP, encoding="utf-8")
    held = grid_of(sweep_of([tmp_path / "sweep.yaml"], Sweep()))
    told = grid_of(sweep_of([path.with_name("*.world.yaml")], Sweep(
        seeds=(0, 1, 2), trials=50, fidelity="kinematic", scenarios=("half",),
        vary=varied(["robots.uv2.fuel_capacity_s=50,60"]))))
    assert held.settings() == told.settings()
    assert len(held.units()) == 2 * 2 * 3
    assert [point.world.robots[1].fuel_capacity_s for point in held.points] == [50, 60, 50, 60]
    assert grid_of(sweep_of([tmp_path / "sweep.yaml"], Sweep(trials=7))).options.trials == 7


def test_settings_give_the_same_grid_again(tmp_path: Path) -> None:
    grid = grid_of(Sweep(worlds=(world(tmp_path),), vary={"noise.wheel_gain_sd": [0.0, 0.02]}))
    (tmp_path / "out").mkdir()
    begin(tmp_path / "out", grid.settings(), resume=False)
    again = grid_from(*settings_in(tmp_path / "out"))
    assert again.settings() == grid.settings()
    assert again.units() == grid.units()


WRONG = [
    ("robots.uv9.fuel_capacity_s", 1, "there is no robot 'uv9'; did you mean 'uv2'?"),
    ("robots.uv2.availability", 1.2, "expected at most 1.0, found 1.2"),
    ("robot.uv1.fuel_capacity_s", 1, "robot: unknown key 'robot'; did you mean 'robots'?"),
    ("robots.uv1.fuel_capacity_s.x", 1, "there is nothing called 'x' to set"),
    ("map.shapes.obstacles.7.radius_m", 1, "there is a list of 3 items at 7; count them from 0"),
    ("map.shapes.obstacles.2.radius_m", -1, "expected at least 1e-06, found -1"),
    ("sites.pois.p9.stop_s", 1, "there is no POI 'p9'; did you mean 'p4'?"),
    ("sites.stations.r2.stop_s", 1, "there is no station 'r2'; did you mean 'r1'?"),
    ("scenarios.hlaf.uv2", 1, "there is no scenario 'hlaf'; did you mean 'half'?"),
    ("robots.uv1.incentives.p9", 1, "there is no POI 'p9'; did you mean 'p4'?"),
    ("sites.pois.p1.at_m", [3.0, 1.0], "inside an obstacle"),
    ("robots.*.fuel_capacity_s", -1, "robots.uv1.fuel_capacity_s: expected at least"),
    ("robots.*.fuel_capacity_s.*", 1, "there is nothing that * could stand for"),
    ("robot.*.fuel_capacity_s", 1, "there is nothing that * could stand for"),
    ("robots.*.loss_cost", "x2", "x2 is relative to the file, which has no number at robots.uv1.loss_cost"),
    ("robots.uv2.availability", "x2", "expected at most 1.0, found 1.5"),
    ("robots.uv1.fuel_capacity_s", "x1.2.3", "expected"),
    ("robots.uv1.model", "x2", "x2"),  # the file has no number there, but a name
]


@pytest.mark.parametrize(("key", "value", "told"), WRONG)
def test_an_invalid_value_is_an_error_of_its_option(key: str, value: object, told: str, tmp_path: Path) -> None:
    path = world(tmp_path)
    with pytest.raises(BadInput) as caught:
        grid_of(Sweep(worlds=(path,), vary={"robots.uv1.availability": [0.5], key: [value]}))
    assert str(caught.value).startswith(f"--set {key}={json.dumps(value)}: ")
    assert told in str(caught.value)
    assert f"(in {path})" in str(caught.value)
    assert ".yaml:" not in str(caught.value)  # the user never wrote it into a line of that file


@pytest.mark.parametrize(("key", "value", "told"), WRONG)
def test_an_invalid_value_is_an_error_of_its_line_in_the_sweep_file(
    key: str, value: object, told: str, tmp_path: Path
) -> None:
    world(tmp_path)
    path = tmp_path / "sweep.yaml"
    path.write_text(SWEEP + f"  {key}: [{json.dumps(value)}]\n", encoding="utf-8")
    with pytest.raises(BadFile) as caught:
        grid_of(sweep_of([path], Sweep()))
    assert str(caught.value).startswith(f"{path}:10: set.{key}: ")
    assert told in str(caught.value)


def test_a_star_moves_all_robots_together_and_a_factor_is_of_what_the_file_says(tmp_path: Path) -> None:
    grid = grid_of(Sweep(worlds=(world(tmp_path),), vary=varied(
        ["robots.*.fuel_capacity_s=40,x1.5"])))
    assert [[robot.fuel_capacity_s for robot in point.world.robots] for point in grid.points] == [[40, 40], [90, 90]]
    assert [point.variant for point in grid.points] == [
        "robots.*.fuel_capacity_s=40", 'robots.*.fuel_capacity_s="x1.5"']


def test_a_star_that_stands_for_thousands_of_places_is_refused_at_once(tmp_path: Path) -> None:
    solids = "".join(f"      - {{cylinder: [{5.0 + k / 10_000}, 5.0], radius_m: 0.01}}\n" for k in range(300))
    path = tmp_path / "many.yaml"
    path.write_text(SMALL.replace("sites:\n", solids + "sites:\n", 1), encoding="utf-8")
    with pytest.raises(BadInput, match=r"\* stands for 303 places; at most 200"):
        grid_of(Sweep(worlds=(path,), vary=varied(["map.shapes.obstacles.*.radius_m=0.02"])))


def test_a_factor_moves_each_by_its_own_value_and_later_keys_build_on_earlier_ones(tmp_path: Path) -> None:
    grid = grid_of(Sweep(worlds=(world(tmp_path),), vary=varied(
        ["robots.uv1.mission_limit_s=200", "robots.*.mission_limit_s=x0.5", "robots.uv1.incentives.*=x1.1"])))
    (point,) = grid.points
    assert [robot.mission_limit_s for robot in point.world.robots] == [100, 60]
    assert dict(point.world.robots[0].incentives) == {"p1": 11, "p2": 22, "p3": 33, "p4": 44}


def test_of_two_values_the_one_that_is_wrong_alone_is_named(tmp_path: Path) -> None:
    # What is said of the whole file names neither key: that nothing is left to go to.
    vary: dict[str, list[object]] = {"robots.uv1.mission_limit_s": [100], "format": ["sva-bench/world@9"]}
    with pytest.raises(BadInput, match=r"^--set format="):
        grid_of(Sweep(worlds=(world(tmp_path),), vary=vary))


def test_a_file_that_is_wrong_by_itself_is_named_all_the_same(tmp_path: Path) -> None:
    path = world(tmp_path)
    path.write_text(path.read_text().replace("availability: 0.75", "availability: 1.75"), encoding="utf-8")
    with pytest.raises(BadFile, match=r"small\.world\.yaml:\d+: robots\.uv2\.availability"):
        grid_of(Sweep(worlds=(path,), vary={"robots.uv1.availability": [0.5]}))


def test_an_unknown_scenario_is_an_error_of_its_option_or_line(tmp_path: Path) -> None:
    path = tmp_path / "sweep.yaml"
    path.write_text(SWEEP.replace("[half]", "[half, hlaf]"), encoding="utf-8")
    world(tmp_path)
    with pytest.raises(BadFile, match=r"sweep\.yaml:6: scenarios\[1\]: .*has no scenario 'hlaf'; did you mean 'half'"):
        grid_of(sweep_of([path], Sweep()))
    with pytest.raises(BadInput, match=r"^--scenario flah: .*small\.world\.yaml has no scenario 'flah'"):
        grid_of(sweep_of([path], Sweep(scenarios=("flah",))))


@pytest.mark.parametrize(("written", "meant"), [
    ("0", (0,)), ("0-2", (0, 1, 2)), ("[0, 2]", (0, 2)), ("[4, 0-2, '7']", (4, 0, 1, 2, 7)), ('"3"', (3,))])
def test_seeds_of_a_file_are_written_like_those_of_the_command_line(
    written: str, meant: tuple[int, ...], tmp_path: Path
) -> None:
    world(tmp_path)
    path = tmp_path / "sweep.yaml"
    path.write_text(SWEEP.replace("seeds: 0-2", f"seeds: {written}"), encoding="utf-8")
    assert sweep_of([path], Sweep()).seeds == meant


@pytest.mark.parametrize("written", ["-1", "5-3", "x", "[1, x]", "1.5"])
def test_an_invalid_seed_is_an_error_of_its_line(written: str, tmp_path: Path) -> None:
    world(tmp_path)
    path = tmp_path / "sweep.yaml"
    path.write_text(SWEEP.replace("seeds: 0-2", f"seeds: {written}"), encoding="utf-8")
    with pytest.raises(BadFile, match=r"sweep\.yaml:3: seeds") as caught:
        sweep_of([path], Sweep())
    assert "--seed" not in str(caught.value)


def test_batches_offer_the_planners_and_failures_of_runs(tmp_path: Path) -> None:
    grid = grid_of(Sweep(worlds=(world(tmp_path),), planners=planners_of(get_args(PathPlanner)), plan_failure="per_leg",
                         execute_failure="mission", evpi=True))
    assert {point.planner for point in grid.points} == set(get_args(PathPlanner))
    assert {(point.world.plan_failure, point.world.execute_failure) for point in grid.points} == {
        ("per_leg", "mission")}
    assert grid.options.evpi
    (tmp_path / "out").mkdir()
    begin(tmp_path / "out", grid.settings(), resume=False)
    assert grid_from(*settings_in(tmp_path / "out")).settings() == grid.settings()


REACTING = [
    ("policy: resolve\n", ("resolve",), (), False), ("policy: [none, resolve]\n", ("none", "resolve"), (), False),
    ("policy: 'none, resolve'\nnews: instant,report\n", ("none", "resolve"), ("instant", "report"), False),
    ("policy: resolve\nnews: [never, report]\nanticipate: true\n", ("resolve",), ("never", "report"), True)]


@pytest.mark.parametrize(("lines", "policies", "news", "anticipate"), REACTING)
def test_reactions_of_a_sweep_file_are_kept_in_the_folder_and_overridden_by_options(
    lines: str, policies: tuple[PolicyName, ...], news: tuple[News, ...], anticipate: bool, tmp_path: Path
) -> None:
    world(tmp_path)
    path = tmp_path / "sweep.yaml"
    path.write_text(SWEEP + lines, encoding="utf-8")
    grid = grid_of(sweep_of([path], Sweep()))
    assert (grid.options.policies, grid.options.news, grid.options.anticipate) == (policies, news, anticipate)
    (tmp_path / "out").mkdir()
    begin(tmp_path / "out", grid.settings(), resume=False)
    again = grid_from(*settings_in(tmp_path / "out"))
    assert again.settings() == grid.settings()
    assert (again.options.policies, again.options.news, again.options.anticipate) == (policies, news, anticipate)
    other = grid_of(sweep_of([path], Sweep(policies=("resolve",), news=("station",)))).options
    assert (other.policies, other.news, other.anticipate) == (("resolve",), ("station",), anticipate)


def test_a_batch_without_reactions_has_the_settings_that_it_had_before_there_were_any(tmp_path: Path) -> None:
    settings = as_dict(grid_of(Sweep(worlds=(world(tmp_path),))).settings())
    assert not {"policies", "news", "anticipate"} & set(settings["options"])
    assert "reaction" not in settings["points"]["small"]["world"]


@pytest.mark.parametrize(("lines", "says"), [
    ("policy: resolv\n", r":10: policy: 'resolv': there is no such policy; did you mean 'resolve'"),
    ("policy: [resolve, resolve]\n", r":10: policy: resolve: given twice"),
    ("policy: []\n", r":10: policy: "), ("policy: 3\n", r":10: policy"), ("policy: 'none,'\n", ":10: policy: .*empty"),
    ("policy: resolve\nnews: [report, soon]\n", r":11: news: 'soon': there is no such kind of news"),
    ("news: instant\n", ":10: news: no policy reacts to it"),
    ("policy: none\nanticipate: true\n", ":11: anticipate: .*small has none"),
    ("anticipate: perhaps\n", ":10: anticipate"),
])
def test_a_reaction_that_makes_no_sense_is_an_error_of_its_line(lines: str, says: str, tmp_path: Path) -> None:
    world(tmp_path)
    path = tmp_path / "sweep.yaml"
    path.write_text(SWEEP + lines, encoding="utf-8")
    with pytest.raises(BadFile, match=rf"sweep\.yaml{says}") as caught:
        grid_of(sweep_of([path], Sweep()))
    assert "--" not in str(caught.value)


def test_a_reaction_of_an_option_is_complained_of_by_the_option_even_beside_a_file(tmp_path: Path) -> None:
    path = tmp_path / "small.world.yaml"
    path.write_text(SMALL.replace("    r1: {at_m: [3.2, 5.2], stop_s: 4}\n", ""), encoding="utf-8")
    sweep = tmp_path / "sweep.yaml"
    sweep.write_text(SWEEP + "policy: resolve\nnews: report\n", encoding="utf-8")
    grid_of(sweep_of([sweep], Sweep()))
    with pytest.raises(BadInput, match=r"^--news: small has no station to hear it at"):
        grid_of(sweep_of([sweep], Sweep(news=("station",))))


def test_varied_reactions_have_an_effect_unless_an_option_says_otherwise(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path, vary = world(tmp_path), {"reaction.policy": ["none", "resolve"]}
    grid = grid_of(Sweep(worlds=(path,), vary=vary))
    assert [point.world.reaction.policy for point in grid.points] == ["none", "resolve"]
    assert caplog.messages == []
    grid_of(Sweep(worlds=(path,), vary=vary, policies=("none",)))
    assert "reaction.policy=\"resolve\" changes nothing" in caplog.text
    with pytest.raises(BadInput, match=r'^--set reaction.news="soon": input should be'):
        grid_of(Sweep(worlds=(path,), vary={"reaction.policy": ["resolve"], "reaction.news": ["soon"]}))


@pytest.mark.parametrize("interaction", INTERACTIONS)
def test_what_robots_are_to_each_other_stands_in_a_sweep_file_and_is_overridden_by_options(
    interaction: Interaction, tmp_path: Path
) -> None:
    world(tmp_path)
    path = tmp_path / "sweep.yaml"
    path.write_text(f"{SWEEP}interaction: {interaction}\n", encoding="utf-8")
    grid = grid_of(sweep_of([path], Sweep()))
    assert {point.world.interaction for point in grid.points} == {interaction}
    (tmp_path / "out").mkdir()
    begin(tmp_path / "out", grid.settings(), resume=False)
    again = grid_from(*settings_in(tmp_path / "out"))
    assert again.settings() == grid.settings()
    assert {point.world.interaction for point in again.points} == {interaction}
    other = grid_of(sweep_of([path], Sweep(interaction="shared")))
    assert {point.world.interaction for point in other.points} == {"shared"}


def test_departures_stand_in_a_sweep_file_are_varied_and_are_told_apart(tmp_path: Path) -> None:
    path = world(tmp_path)
    grid = grid_of(Sweep(worlds=(path,), interaction="shared", vary={"departures": ["together", "staggered"]}))
    assert [point.world.departures for point in grid.points] == ["together", "staggered"]
    assert {point.world.interaction for point in grid.points} == {"shared"}
    (tmp_path / "sweep.yaml").write_text(f"{SWEEP}interaction: shared\ndepartures: staggered\n", encoding="utf-8")
    grid = grid_of(sweep_of([tmp_path / "sweep.yaml"], Sweep()))
    assert {point.world.departures for point in grid.points} == {"staggered"}
    with pytest.raises(BadInput, match="departures can't be staggered under interaction independent"):
        grid_of(Sweep(worlds=(path,), departures="staggered"))


def test_an_unknown_interaction_is_an_error_of_its_line_or_option(tmp_path: Path) -> None:
    path = world(tmp_path)
    sweep = tmp_path / "sweep.yaml"
    sweep.write_text(f"{SWEEP}interaction: joint\n", encoding="utf-8")
    with pytest.raises(BadFile, match=r"sweep\.yaml:10: interaction: .*'uncoordinated' or 'shared', found 'joint'"):
        sweep_of([sweep], Sweep())
    with pytest.raises(BadInput, match=r'^--set interaction="joint": input should be'):
        grid_of(Sweep(worlds=(path,), vary={"interaction": ["joint"]}))


def test_interaction_is_varied_and_an_option_that_says_otherwise_takes_its_effect(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path, vary = world(tmp_path), {"interaction": list(INTERACTIONS)}
    grid = grid_of(Sweep(worlds=(path,), vary=vary))
    assert [point.world.interaction for point in grid.points] == list(INTERACTIONS)
    assert caplog.messages == []
    grid_of(Sweep(worlds=(path,), vary=vary, interaction="independent"))
    assert "interaction=\"uncoordinated\" changes nothing" in caplog.text


def test_slots_are_varied_to_an_effect_where_robots_meet(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path, vary = world(tmp_path), {"sites.stations.r1.slots": [1, 2]}
    grid = grid_of(Sweep(worlds=(path,), vary=vary, interaction="shared"))
    assert [point.world.stations[0].slots for point in grid.points] == [1, 2]
    assert caplog.messages == []
    grid_of(Sweep(worlds=(path,), vary=vary))
    assert "sites.stations.r1.slots=2 changes nothing" in caplog.text


@pytest.mark.parametrize("key", ["noise.payload_kg", "noise.hull_friction"])
def test_what_acts_in_physics_alone_gives_a_warning_if_the_twin_drives(
        tmp_path: Path, caplog: pytest.LogCaptureFixture, key: str) -> None:
    vary = {key: [[0, 0], [1, 2]] if key.endswith("kg") else [0.0, 0.4], "noise.wheel_gain_sd": [0.0, 0.02]}
    grid_of(Sweep(worlds=(world(tmp_path),), vary=vary, fidelity="rollout"))
    assert caplog.messages == []
    grid_of(Sweep(worlds=(world(tmp_path),), vary=vary, fidelity="kinematic"))
    assert caplog.messages == [f"{key} is varied to no effect: kinematic trials know nothing of it"]


def test_an_invalid_sweep_file_is_an_error_with_line_and_key(tmp_path: Path) -> None:
    path = tmp_path / "sweep.yaml"
    path.write_text(SWEEP.replace("trials: 50", "trails: 50"), encoding="utf-8")
    with pytest.raises(BadFile, match=r"sweep\.yaml:4: trails"):
        sweep_of([path], Sweep())


def test_trials_are_cut_into_units_that_cover_each_once(tmp_path: Path) -> None:
    grid = grid_of(Sweep(worlds=(world(tmp_path),), trials=25, unit_trials=10))
    assert grid.ranges() == [(0, 10), (10, 10), (20, 5)]
    assert grid.units() == ["small-seed0-t00000000", "small-seed0-t00000010", "small-seed0-t00000020"]


def test_a_dry_run_counts_what_is_left(tmp_path: Path) -> None:
    grid = grid_of(Sweep(worlds=(world(tmp_path),), trials=25, unit_trials=10, seeds=(0, 1)))
    listed = estimates(grid, Cache(folder=tmp_path / "cache"), tmp_path / "out")
    assert [(e.units, e.rows) for e in listed] == [(3, 25 * 2 * 2 * 2)] * 2
    assert listed[0].processor_s > 0
    # Where all is cached there is still the start of two processes, and something for each unit.
    assert total_s(listed) > sum(e.processor_s for e in listed) > 6 * 0.1
    assert total_s([]) == 0
    done = sva_bench("batch", world(tmp_path), "--trials", 25, "--dry-run", "--cache", "cache", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "1 unit, 200 rows" in done.stdout
    assert sorted(path.name for path in tmp_path.iterdir()) == ["small.world.yaml"]


def test_a_varied_key_without_effect_gives_a_warning(
        tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = world(tmp_path)
    grid_of(Sweep(worlds=(path,), vary={"noise.wheel_gain_sd": [0.0, 0.02]}))
    assert "changes nothing" not in caplog.text
    ruled = {"s": {"uv1": 1.0, "uv2": 0.5}}
    grid_of(Sweep(worlds=(path,), vary={"scenarios": [ruled], "robots.uv2.availability": [0.3, 0.7]}))
    assert "robots.uv2.availability=0.7 changes nothing" in caplog.text
