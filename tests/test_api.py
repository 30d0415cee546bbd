"""What ``import sva_bench`` offers: the same figures as the commands, and a clear message where something is wrong."""

from __future__ import annotations

import inspect
import json
import os
import pickle
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, get_type_hints

import pyarrow.parquet as pq
import pytest

import sva_bench as sb
from sva_bench.__main__ import run_command_line
from sva_bench.analysis.summaries import Summary
from sva_bench.cli import plans as plan_commands
from sva_bench.cli import run as run_commands
from sva_bench.errors import BadFile, BadInput, UnknownName
from sva_bench.files.pretty import pretty_json
from sva_bench.recording.rerun import end_s
from sva_bench.study.given_plans import InfeasiblePlan
from sva_bench.study.public.arguments import by_argument
from sva_bench.travel.times import UnreachableSite
from tests.reference import ERRORS, TYPES, reference
from tests.worlds_for_tests import SMALL, world_of

FUNCTIONS = ("load_world", "travel_times", "fuel_costs", "make_instance", "plan", "certify", "execute", "run", "record")
QUICK: dict[str, Any] = {"trials": 40, "rollouts": 2, "fidelity": "kinematic", "workers": 1}
TYPED = ("--trials", "40", "--rollouts", "2", "--fidelity", "kinematic", "--workers", "1")


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("world") / "small.yaml"
    path.write_text(SMALL, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def world(small: Path) -> sb.World:
    return sb.load_world(small)


@pytest.fixture(scope="module")
def instance(world: sb.World) -> sb.Instance:
    return sb.make_instance(world, scenario="half")


@pytest.fixture(scope="module")
def result(world: sb.World) -> sb.Result[Summary]:
    return sb.run(world, **QUICK)


# Names


def test_every_public_name_is_there_and_is_listed() -> None:
    assert set(FUNCTIONS) | {"Summary"} <= set(sb.__all__)
    assert sorted([*sb.__all__, "__version__"]) == dir(sb)  # and no module or helper that happens to be loaded
    for name in sb.__all__:
        assert getattr(sb, name).__module__.startswith("sva_bench.")
    assert re.fullmatch(r"\d+\.\d+.*", sb.__version__)
    with pytest.raises(AttributeError, match="no attribute 'plann'"):
        sb.plann  # noqa: B018


def test_what_type_checkers_are_told_is_what_is_loaded() -> None:
    tree = Path(str(sb.__file__)).read_text(encoding="utf-8")
    told = {name: home for home, names in re.findall(r"^    from sva_bench\.(\S+) import (.+)$", tree, re.MULTILINE)
            for name in names.split(", ")}
    told = {name: home for name, home in told.items() if name in sb.__all__}
    assert told == sb._HOMES
    assert sorted(told) == sorted(sb.__all__)


def test_importing_loads_nothing_that_takes_long_until_a_name_is_used() -> None:
    code = ("import sys, sva_bench as sb; dir(sb)\n"
            "print(sorted({'numpy', 'pydantic', 'typing', 'importlib.metadata'} & set(sys.modules)))")
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_reading_a_world_loads_neither_physics_nor_solvers(small: Path) -> None:
    code = ("import sys, sva_bench as sb; sb.load_world(sys.argv[1])\n"
            "print(sorted({'pybullet', 'highspy', 'rerun', 'ompl'} & set(sys.modules)))")
    said = subprocess.run([sys.executable, "-c", code, str(small)], capture_output=True, text=True, check=True)
    assert said.stdout == "[]\n"


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_is_typed_takes_options_by_name_alone_and_says_what_it_takes_gives_and_raises(name: str) -> None:
    function = getattr(sb, name)
    hints, parameters = get_type_hints(function), inspect.signature(function).parameters
    assert set(parameters) | {"return"} <= set(hints)
    free = {"execute": 2, "certify": 2, "record": 2}.get(name, 1)
    kinds = [parameter.kind is parameter.KEYWORD_ONLY for parameter in parameters.values()]
    assert kinds == [False] * free + [True] * (len(kinds) - free)
    told = inspect.getdoc(function) or ""
    assert "Args:" in told
    assert "Raises:" in told
    for parameter in parameters:
        assert re.search(rf"\b{parameter}\b", told), parameter


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_error_that_a_function_is_said_to_raise_can_be_caught_by_a_public_name(name: str) -> None:
    told = (inspect.getdoc(getattr(sb, name)) or "").partition("Raises:")[2].partition("Source:")[0]
    entries = re.findall(r"^    (\w+(?:, \w+)*): ", told, re.MULTILINE)
    raised = {error for names in entries for error in names.split(", ")}
    assert raised
    for error in raised - {"ValueError", "KeyboardInterrupt"}:
        assert issubclass(getattr(sb, error), sb.SvaBenchError), error
        assert error in ERRORS


@pytest.mark.parametrize("name", TYPES)
def test_the_reference_shows_methods_as_calls_and_attributes_as_attributes(name: str) -> None:
    told = reference().split(f"### `sb.{name}`\n")[1].split("\n### ")[0].split("\n## ")[0]
    for member, call in re.findall(r"^- `\.(\w+)(\(\))?`:", told, re.MULTILINE):
        assert bool(call) == (not isinstance(getattr(getattr(sb, name), member), property)), member


def test_every_public_error_is_in_the_reference() -> None:
    assert {name for name in sb.__all__ if isinstance(getattr(sb, name), type)
            and issubclass(getattr(sb, name), Exception)} == set(ERRORS)


@pytest.mark.parametrize(("function", "command"), [
    (sb.run, run_commands.run), (sb.execute, run_commands.execute), (sb.plan, plan_commands.plan),
], ids=lambda function: function.__name__)
def test_arguments_are_named_as_options_are_and_have_their_defaults(
    function: Callable[..., Any], command: Callable[..., Any]
) -> None:
    mine, typed = inspect.signature(function).parameters, inspect.signature(command).parameters
    # What is printed and how wide, files that ``.outcomes`` stands for, a window, and what an instance says itself.
    only_typed = {"csv", "as_json", "verbose", "wide", "live", *({"plan_failure"} if function is sb.plan else ())}
    assert set(mine) - {"progress"} == set(typed) - only_typed
    for name in set(mine) & set(typed) - {"out"}:  # without ``out`` nothing is written
        assert mine[name].default == typed[name].default, name


# Results


def test_a_run_has_the_same_summary_and_tables_as_the_command(
    small: Path, tmp_path: Path, result: sb.Result[Summary]
) -> None:
    assert run_command_line(["run", str(small), *TYPED, "--out", str(tmp_path / "typed")]) == 0
    (typed,) = (tmp_path / "typed").iterdir()
    mine = sb.run(small, **QUICK, out=tmp_path / "mine").folder
    assert mine is not None
    assert mine.name == typed.name
    for name in ("summary.json", "outcomes.parquet", "legs.parquet", "travel_times.parquet"):
        assert (mine / name).read_bytes() == (typed / name).read_bytes(), name
    assert {path.name for path in mine.iterdir()} == {path.name for path in typed.iterdir()}
    # And without a folder, of a world read before.
    assert pretty_json(result.as_dict()).encode() == (typed / "summary.json").read_bytes()
    assert result.outcomes.equals(pq.read_table(typed / "outcomes.parquet"))
    assert result.legs.equals(pq.read_table(typed / "legs.parquet"))


@pytest.mark.long
def test_executed_plans_have_the_same_summary_as_the_command(small: Path, tmp_path: Path) -> None:
    paths = []
    for name, poi in (("a", "p1"), ("b", "p2")):
        path = tmp_path / f"{name}.json"
        path.write_text(json.dumps({"format": "sva-bench/plan@1", "routes": {"uv1": ["base", poi, "base"]}}))
        paths.append(path)
    assert run_command_line(["execute", str(small), *map(str, paths), *TYPED, "--out", str(tmp_path / "typed")]) == 0
    (typed,) = (tmp_path / "typed").iterdir()
    plans = {name: sb.Plan(routes={"uv1": ("base", poi, "base")}) for name, poi in (("a", "p1"), ("b", "p2"))}
    given: Any
    for given in (paths, plans, {"a": str(paths[0]), "b": plans["b"]}):
        done = sb.execute(small, given, **QUICK, out=str(tmp_path / "mine"))
        assert done.folder is not None
        assert (done.folder / "summary.json").read_bytes() == (typed / "summary.json").read_bytes()
        assert done.folder.name == typed.name


def test_one_plan_is_executed_by_itself(world: sb.World, instance: sb.Instance) -> None:
    made = sb.plan(instance)
    done = sb.execute(world, made, scenario="half", **QUICK)
    assert list(done.plans) == ["half"]
    assert done.plans["half"] == {"plan": made}
    assert done.summary.scenario("half").plans["plan"].expected == pytest.approx(made.value)


def test_stage_by_stage_it_is_the_plan_of_the_whole_run(
    world: sb.World, instance: sb.Instance, result: sb.Result[Summary], small: Path, tmp_path: Path
) -> None:
    times = sb.travel_times(world)
    costs = sb.fuel_costs(world, times=times)
    staged = sb.make_instance(world, scenario="half", costs=costs, output=tmp_path / "i.json")
    assert staged.vehicles[0].fuel_s.tolist() == instance.vehicles[0].fuel_s.tolist()
    made = sb.plan(tmp_path / "i.json", output=tmp_path / "p.json")
    assert made.routes == result.plans["half"]["stochastic"].routes == sb.plan(small, scenario="half").routes
    assert sb.certify(tmp_path / "i.json", tmp_path / "p.json") == sb.certify(staged, made)
    assert sb.certify(staged, made).feasible
    wider = sb.fuel_costs(world, times=times, margin=0.5)
    assert (wider["turtlebot2"].cost_s >= costs["turtlebot2"].cost_s).all()


def test_a_plan_is_what_the_command_writes(small: Path, tmp_path: Path) -> None:
    assert run_command_line(["plan", str(small), "--scenario", "half", "--objective", "deterministic", "-o",
                             str(tmp_path / "typed.json")]) == 0
    sb.plan(small, scenario="half", objective="deterministic", output=tmp_path / "mine.json")
    typed, mine = (json.loads((tmp_path / name).read_text()) for name in ("typed.json", "mine.json"))
    assert {**typed, "runtime_s": 0} == {**mine, "runtime_s": 0}


def test_without_a_place_nothing_is_written(world: sb.World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    sb.run(world, scenario="half", **QUICK)
    assert list(tmp_path.iterdir()) == []


def test_a_recording_is_written_where_it_is_asked_for(result: sb.Result[Summary], tmp_path: Path) -> None:
    assert sb.record(result, tmp_path / "x.rrd") == tmp_path / "x.rrd"
    sb.record(result, str(tmp_path / "y.rrd"), scenario="half", planner="stochastic")  # the first of each
    assert end_s(tmp_path / "x.rrd") == end_s(tmp_path / "y.rrd") > 10
    for wrong, said in (({"scenario": "hlaf"}, "scenario 'hlaf': .*did you mean 'half'"),
                        ({"planner": "informed"}, "planner 'informed'")):
        with pytest.raises(BadInput, match=said):
            sb.record(result, tmp_path / "z.rrd", **wrong)  # type: ignore[arg-type]
    with pytest.raises(BadInput, match=r"end in \.rrd"):
        sb.record(result, tmp_path / "z.txt")


def test_progress_is_told_to_whoever_asks(world: sb.World) -> None:
    heard: dict[str, tuple[int, int]] = {}

    def hear(what: str, done: int, of: int) -> None:
        heard[what] = done, of

    sb.run(world, scenario="half", **QUICK, progress=hear)
    assert {"planning paths", "solving", "driving routes"} <= set(heard)
    assert all(done == of for done, of in heard.values())


def test_results_are_shown_in_a_few_lines_and_as_an_escaped_table(
    world: sb.World, instance: sb.Instance, result: sb.Result[Summary]
) -> None:
    made = sb.plan(instance)
    costs = sb.fuel_costs(world)
    for thing in (world, instance, made, sb.certify(instance, made), result, result.summary, *costs.values(),
                  *sb.travel_times(world).values()):
        assert len(repr(thing)) < 500, repr(thing)
        assert "array(" not in repr(thing)
    assert "optimal, value" in repr(made)
    assert "VSS" in repr(result)
    for table in (made, sb.certify(instance, made), result, result.summary):
        assert table._repr_html_().startswith("<table>")
    foreign = sb.Plan(routes={"<script>": ("base", "<b>", "base")}, status=None)
    assert "<script>" not in foreign._repr_html_()
    assert "&lt;b&gt;" in foreign._repr_html_()


# Errors

WRONG: list[tuple[dict[str, Any], str]] = [
    ({"trials": 0}, r"trials 0: expected 1 to 10000000"), ({"rollouts": 100_001}, "rollouts 100001"),
    ({"seed": -1}, r"seed -1: expected 0 to 9223372036854775807$"),
    ({"trials": 10**5000}, "trials with 16610 bits: expected 1 to"), ({"margin": 10**400}, "margin inf"),
    ({"margin": 1.0000001}, r"margin 1\.0000001: expected 0 to 1"), ({"out": "a\0b"}, r"out: 'a\\x00b' holds a null"),
    ({"fidelity": "kinematik"}, "fidelity 'kinematik': did you mean 'kinematic'"),
    ({"planner": "rrt"}, "planner 'rrt'"), ({"scenario": "hlaf"}, "scenario hlaf: .*did you mean 'half'"),
    ({"scenario": ["half", "half"]}, "scenario half: given twice"), ({"margin": 2}, "margin 2: expected 0 to 1"),
    ({"margin": float("nan")}, "margin nan"), ({"gap": -1}, "gap -1"), ({"time_limit": float("inf")}, "time_limit inf"),
    ({"max_trials": 5}, "max_trials belongs to precision"), ({"precision": "1"}, "precision 1: expected per cent"),
    ({"precision": 1, "max_trials": 5}, "max_trials 5 is less than trials 40"), ({"workers": 10_000}, "workers 10000"),
    ({"execute_failure": "hazards"}, "execute_failure 'hazards'"), ({"out": ""}, "out: an empty path"),
    ({"informed": True, "execute_failure": "per_leg"}, "leave out informed"),
    ({"policy": "resolv"}, "^policy 'resolv': .*did you mean 'resolve'"),
    ({"policy": ["resolve", "resolve"]}, "^policy resolve: given twice"), ({"policy": ""}, "^policy '': an entry is"),
    ({"news": "report"}, "^news: no policy reacts to it"), ({"news": "report,soon"}, "^news 'soon'"),
    ({"anticipate": True}, "^anticipate: .* small has none; add the policy resolve"),
]
MISTYPED: list[tuple[dict[str, Any], str]] = [
    ({"trials": "many"}, "trials: expected an integer, found str 'many'"), ({"trials": 1.5}, "trials"),
    ({"trials": True}, "trials"), ({"fidelity": 3}, "fidelity: expected a word"), ({"out": 3}, "out: expected a path"),
    ({"scenario": 3}, "scenario"), ({"margin": "a"}, "margin"), ({"evpi": 1}, "evpi: expected True or False"),
    ({"progress": 3}, "progress"), ({"out": b"x"}, "out: expected a path"), ({"policy": 3}, "policy: expected a name"),
    ({"news": []}, "news: expected a name or a list"), ({"anticipate": "yes"}, "anticipate: expected True or False"),
    ({"world": 3}, "world: expected a world or the path of its file, found int 3"),
]


@pytest.mark.parametrize(("wrong", "said"), WRONG)
def test_a_value_that_cannot_be_meant_is_refused_by_the_name_of_the_argument(
    world: sb.World, wrong: dict[str, Any], said: str
) -> None:
    with pytest.raises(BadInput, match=said) as refused:
        sb.run(world, **{**QUICK, **wrong})
    assert "--" not in str(refused.value)
    assert isinstance(refused.value, sb.SvaBenchError)


@pytest.mark.parametrize(("wrong", "said"), MISTYPED)
def test_an_argument_of_a_wrong_type_is_a_value_error(world: sb.World, wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        sb.run(**{"world": world, **QUICK, **wrong})


def test_given_plans_react_and_one_is_made_for_the_reaction(world: sb.World) -> None:
    plan = sb.Plan(routes={"uv1": ("base", "p1", "base")})
    with pytest.raises(BadInput, match=r"^anticipate: plans for a reaction"):
        sb.execute(world, plan, anticipate=True, **QUICK)
    made = sb.execute(world, {"mine": plan}, policy="resolve", anticipate=True, **QUICK)
    for scenario in made.summary.scenarios:
        assert scenario.reactions is not None
        (reaction,) = scenario.reactions
        assert set(reaction.plans) == {"mine", "anticipative"}
        assert reaction.plans["anticipative"].modelled >= reaction.plans["mine"].modelled
        assert set(scenario.plans) == {"mine"}
    with pytest.raises(BadInput, match=r"^news: no policy reacts"):
        sb.execute(world, plan, news="instant", **QUICK)
    sb.execute(world, plan, policy=["none", "resolve"], news=["report", "instant"], **QUICK)


def test_inputs_of_a_wrong_type_are_value_errors(world: sb.World) -> None:
    given: Any = 3
    calls: list[Callable[[], object]] = [
        lambda: sb.load_world(given), lambda: sb.run(given), lambda: sb.travel_times(given),
        lambda: sb.fuel_costs(world, times=given), lambda: sb.make_instance(world, costs=given),
        lambda: sb.plan(given), lambda: sb.certify(given, given), lambda: sb.execute(world, given),
        lambda: sb.execute(world, [given]), lambda: sb.execute(world, {given: given}),
        lambda: sb.record(given, "x.rrd")]
    for call in calls:
        with pytest.raises(ValueError, match="expected"):
            call()


def test_where_an_object_may_be_given_the_message_says_so_beside_the_path(
    world: sb.World, instance: sb.Instance
) -> None:
    given: Any = 3
    for call, said in (
            (lambda: sb.plan(given), "source: expected an instance, a world, or the path"),
            (lambda: sb.certify(given, given), "instance: expected an instance or the path"),
            (lambda: sb.certify(instance, given), "plan: expected a plan or the path"),
            (lambda: sb.execute(world, {"a": given}), r"plans\['a'\]: expected a plan or the path"),
            (lambda: sb.travel_times(given), "world: expected a world or the path")):
        with pytest.raises(ValueError, match=said):
            call()


def test_a_path_with_a_null_character_is_refused_wherever_one_is_taken(
    world: sb.World, instance: sb.Instance, result: sb.Result[Summary]
) -> None:
    bad, plan = "a\0.json", sb.Plan(routes={})
    for call in (
            lambda: sb.load_world(bad), lambda: sb.make_instance(world, output=bad), lambda: sb.plan(bad),
            lambda: sb.plan(instance, output=bad), lambda: sb.certify(bad, plan), lambda: sb.certify(instance, bad),
            lambda: sb.execute(world, [bad]), lambda: sb.execute(world, {"a": bad}),
            lambda: sb.execute(world, plan, out=bad), lambda: sb.run(world, out=bad),
            lambda: sb.record(result, "a\0.rrd")):
        with pytest.raises(BadInput, match="holds a null character"):
            call()


WRONG_PLANS: list[tuple[dict[str, Any], str]] = [
    ({"routes": None}, "routes: expected the route of each robot by its name, found nothing"),
    ({"routes": ["base"]}, "routes: .*found list"), ({"routes": {1: ("base",)}}, "names of robots"),
    ({"routes": {"uv1": (1, 2)}}, r"routes\['uv1'\]\[0\]: expected the name of a site, found int"),
    ({"routes": {"uv1": "base"}}, r"routes\['uv1'\]: expected the names of its sites, .*found str"),
    ({"routes": {"uv1": None}}, r"routes\['uv1'\]: .*found nothing"), ({"routes": {"uv1": 3}}, "found int"),
    ({"routes": {}, "fuel_s": None}, "fuel_s: .*found nothing"), ({"routes": {}, "value": "x"}, "value: expected"),
    ({"routes": {}, "fuel_s": {"uv1": "x"}}, r"fuel_s\['uv1'\]: expected a number"),
    ({"routes": {}, "details": None}, "details"), ({"routes": {}, "bound": True}, "bound: expected a number"),
]


@pytest.mark.parametrize(("wrong", "said"), WRONG_PLANS)
def test_what_is_no_plan_is_refused_as_it_is_made(wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        sb.Plan(**wrong)


def test_routes_may_be_lists_as_in_a_file(instance: sb.Instance) -> None:
    route: Any = ["base", "p1", "base"]
    plan = sb.Plan(routes={"uv1": route})
    assert plan.routes == {"uv1": ("base", "p1", "base")}
    assert sb.certify(instance, plan).feasible


@pytest.mark.parametrize("route", [(), ("base",), ("base", "base")])
def test_a_robot_stays_home_by_the_same_routes_as_in_a_file(
    instance: sb.Instance, tmp_path: Path, route: tuple[str, ...]
) -> None:
    path = tmp_path / "plan.json"
    path.write_text(json.dumps({"format": "sva-bench/plan@1", "routes": {"uv1": route}}))
    found = sb.certify(instance, sb.Plan(routes={"uv1": route}))
    assert found.feasible
    assert found == sb.certify(instance, path)


def test_other_availabilities_are_probabilities_of_vehicles_that_are_there(instance: sb.Instance) -> None:
    changed = instance.with_availability({"uv1": 0.25})
    assert [v.availability for v in changed.vehicles] == [0.25, instance.vehicles[1].availability]
    with pytest.raises(BadInput, match="no vehicle 'uv9'; did you mean"):
        instance.with_availability({"uv9": 0.5})
    for wrong in (2, -0.1, float("nan"), float("inf")):
        with pytest.raises(BadInput, match=r"availability of uv1: .* is no probability; expected 0 to 1"):
            instance.with_availability({"uv1": wrong})
        with pytest.raises(ValueError, match="availability of uv1: expected 0 to 1"):
            replace(instance.vehicles[0], availability=wrong)
    half: Any = "half"
    with pytest.raises(ValueError, match="availability of uv1: expected a number, found str"):
        instance.with_availability({"uv1": half})


def test_a_name_that_is_not_there_is_bad_input_and_a_key_error_and_names_the_nearest(
    world: sb.World, instance: sb.Instance, result: sb.Result[Summary]
) -> None:
    (times,), (costs,) = (sb.travel_times(world).values(), sb.fuel_costs(world).values())
    for call, said in (
            (lambda: world.scenario("hlaf"), "small has no scenario 'hlaf'; did you mean 'half'?"),
            (lambda: result.summary.scenario("hlaf"), "small has no scenario 'hlaf'; did you mean 'half'?"),
            (lambda: instance.vehicle("uv9"), "small-half has no vehicle 'uv9'; did you mean 'uv2'?"),
            (lambda: times.path("bsae", "p1"), "there is no site 'bsae'; did you mean 'base'?"),
            (lambda: times.path("base", "bsae"), "there is no site 'bsae'; did you mean 'base'?"),
            (lambda: times.course("base", "bsae"), "there is no site 'bsae'; did you mean 'base'?"),
            (lambda: costs.chain("bsae", "p1"), "there is no site 'bsae'; did you mean 'base'?")):
        with pytest.raises(UnknownName) as refused:
            call()
        assert isinstance(refused.value, KeyError)
        assert isinstance(refused.value, sb.SvaBenchError)
        assert str(refused.value) == said
        again = pickle.loads(pickle.dumps(refused.value))  # as it comes from a worker
        assert (type(again), str(again)) == (UnknownName, said)


def test_plans_that_cannot_be_driven_are_refused_by_the_name_that_they_go_by(world: sb.World) -> None:
    def execute(*route: str, robot: str = "uv1", name: str = "mine") -> None:
        sb.execute(world, {name: sb.Plan(routes={robot: route})}, **QUICK)

    with pytest.raises(InfeasiblePlan, match=r"plans\['mine'\]: the plan is infeasible"):
        execute("base", "p1", "p1", "base")
    with pytest.raises(BadInput, match=r"plans\['mine'\]: uv1: there is no site 'p9'"):
        execute("base", "p9", "base")
    with pytest.raises(BadInput, match="there is no vehicle 'uv3'"):
        execute("base", "p1", "base", robot="uv3")
    for name, problem in (("a/b", "holds a slash"), ("", "is empty"), ("a\nb", "can't be shown"),
                          ("n" * 200, "longer")):
        with pytest.raises(BadInput, match=problem):
            execute("base", "p1", "base", name=name)
    with pytest.raises(BadInput, match="there is none"):
        sb.execute(world, {})
    plan = sb.Plan(routes={})
    with pytest.raises(BadInput, match="must differ"):
        sb.execute(world, {"a": plan, "A": plan})


def test_what_belongs_to_another_world_is_refused(world: sb.World, small: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.yaml"
    other.write_text(SMALL.replace("    p4: {at_m: [4.2, 0.8]}\n", "").replace(", p4: 40", "").replace(", p4: 10", ""))
    with pytest.raises(BadInput, match="not of the sites of small"):
        sb.make_instance(world, costs=sb.fuel_costs(other))
    with pytest.raises(BadInput, match="margin"):
        sb.make_instance(world, costs=sb.fuel_costs(world), margin=0.1)
    with pytest.raises(BadInput, match="scenario belongs to a world"):
        sb.plan(sb.make_instance(small), scenario="half")
    with pytest.raises(BadInput, match="beta belongs to risk cvar"):
        sb.plan(small, beta=0.5)


def test_a_site_out_of_reach_is_said_of_the_file_where_there_is_one(tmp_path: Path) -> None:
    walled = tmp_path / "walled.yaml"
    walled.write_text(SMALL.replace("[[3.0, 0.0], [3.0, 2.6]]", "[[2.7, 0.0], [2.7, 6.0]]"))
    with pytest.raises(BadFile, match=r"walled\.yaml:\d+: sites"):
        sb.travel_times(walled)
    with pytest.raises(UnreachableSite):
        sb.travel_times(sb.load_world(walled))


def test_options_in_messages_become_arguments() -> None:
    assert by_argument("--max-trials 5 is less than --trials 10") == "max_trials 5 is less than trials 10"
    assert by_argument("a -- b, x--y, -o") == "a -- b, x--y, -o"


# Processes

SCRIPT = """
import sys
import sva_bench as sb

print("once")
result = sb.run(sys.argv[1], trials=10, rollouts=2, fidelity="kinematic", scenario="half", workers=2)
print(result.summary.scenario("half").vss.executed.mean)
"""


@pytest.mark.long
def test_a_script_without_a_guard_of_its_main_module_has_workers(small: Path, tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT, encoding="utf-8")
    done = subprocess.run([sys.executable, script, small], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[0] == "once"
    assert len(done.stdout.splitlines()) == 2


@pytest.mark.long
def test_an_interactive_session_has_workers(small: Path, tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-i", "-", small], input=SCRIPT, capture_output=True, text=True,
                          timeout=300, cwd=tmp_path, check=False)
    assert len(done.stdout.splitlines()) == 2, done.stdout + done.stderr


INTERRUPTED = """
import sys, time
import sva_bench as sb

def told(what, done, of):
    if what == "driving routes":
        print("driving", flush=True)

try:
    sb.run(sys.argv[1], trials=100_000, rollouts=1000, workers=2, out="runs", progress=told)
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


@pytest.mark.long
def test_ctrl_c_is_a_keyboard_interrupt_and_leaves_nothing_behind(small: Path, tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(INTERRUPTED, encoding="utf-8")
    process = subprocess.Popen([sys.executable, script, small], cwd=tmp_path, stdout=subprocess.PIPE, text=True,
                               start_new_session=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "driving\n"
    os.kill(process.pid, signal.SIGINT)
    rest = process.stdout.read()
    assert process.wait(60) == 0
    assert rest.splitlines()[-1] == "interrupted"
    assert not list(tmp_path.glob("runs/*"))
    assert not list(tmp_path.glob("runs/.*"))
    until = time.monotonic() + 10
    while _children_of(process.pid) and time.monotonic() < until:
        time.sleep(0.1)
    assert not _children_of(process.pid)


def _children_of(session: int) -> list[str]:
    """Processes that are left of a session."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            words = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(words[3]) == session and words[0] != "Z":
            found.append(stat.parent.name)
    return found


def test_costs_of_sites_of_the_same_names_elsewhere_are_refused(tmp_path: Path) -> None:
    world = world_of(tmp_path)
    site = world.sites[-1]
    moved = replace(world, sites=(*world.sites[:-1], replace(site, x_m=site.x_m + 0.1)))
    with pytest.raises(BadInput, match="make them for this world"):
        sb.make_instance(moved, costs=sb.fuel_costs(world))
    with pytest.raises(BadInput, match="make them for this world"):
        sb.fuel_costs(moved, times=sb.travel_times(world))


def test_a_team_that_reacts_is_recorded_and_its_rows_are_beside_the_others(tmp_path: Path) -> None:
    path = tmp_path / "w.yaml"
    path.write_text(SMALL.replace("limit_s: 120", "limit_s: 30"), encoding="utf-8")
    result = sb.run(path, policy="resolve", news=["report", "instant"], scenario=["half", "safe"], trials=4, rollouts=1,
                    fidelity="kinematic", workers=1)
    assert set(result.outcomes["policy"].to_pylist()) == set(result.legs["policy"].to_pylist()) == {"none", "resolve"}
    assert sb.record(result, tmp_path / "r.rrd", policy="resolve").is_file()
    assert (tmp_path / "r.rrd").stat().st_size > sb.record(result, tmp_path / "n.rrd").stat().st_size / 2
    for changes, said in ((("safe", "resolve", None), "orders never change"), (("half", "resolve", "station"), "news")):
        scenario, policy, news = changes
        with pytest.raises(BadInput, match=said):
            sb.record(result, tmp_path / "x.rrd", scenario=scenario, policy=policy, news=news)  # type: ignore[arg-type]
    assert not (tmp_path / "x.rrd").exists()
