"""Ctrl-C in the middle of compiled code and of programs: the best plan so far is kept."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sva_bench.choices import InstanceFamily, Method
from sva_bench.generate.instances import random_instance
from sva_bench.interrupts import deferring_ctrl_c
from sva_bench.mission.certify import certify
from sva_bench.mission.instance import Instance
from sva_bench.mission.instance_file import write_instance
from sva_bench.mission.plan import Plan
from sva_bench.mission.plan_file import read_plan
from sva_bench.solver.columns import column_generation, pricing
from sva_bench.solver.columns.graph import graph_of, neighbours
from sva_bench.solver.columns.listing import counts
from sva_bench.solver.columns.pricing import Priced, price
from sva_bench.solver.columns.subset_row import cut_duals_of
from sva_bench.solver.discounts import Discount
from sva_bench.solver.edges import program as edge_program
from sva_bench.solver.edges import tree as edge_tree
from sva_bench.solver.flow import branch_and_cut, lshaped
from sva_bench.solver.preprocess import scope_of
from sva_bench.solver.risk import RiskMeasure
from sva_bench.solver.routes import fronts as routes
from sva_bench.solver.routes import heuristic, long_routes
from sva_bench.solver.two_stage import plan_averse, plan_deterministic, plan_stochastic

SOON_S = 0.2  # from the outside: compiled code keeps this process from doing anything


def hard(family: InstanceFamily = "A", pois: int = 60, *, vehicles: int = 2, directed: bool = True) -> Instance:
    """An instance that takes minutes."""
    return random_instance(family, pois=pois, vehicles=vehicles, availability=0.75, seed=1, directed=directed)


def press_soon() -> None:
    subprocess.Popen(["sh", "-c", f"sleep {SOON_S}; kill -INT {os.getpid()}"])


def at_call(monkeypatch: pytest.MonkeyPatch, where: object, name: str, number: int = 1) -> None:
    """Press Ctrl-C soon after the first, or a later, call of a function begins."""
    real: Callable[..., object] = getattr(where, name)
    calls: list[str] = []

    def pressing(*arguments: object, **options: object) -> object:
        calls.append(name)
        if len(calls) == number:
            press_soon()
        return real(*arguments, **options)

    monkeypatch.setattr(where, name, pressing)


@pytest.fixture(scope="module", autouse=True)
def _compiled() -> None:
    """Have everything compiled: it is not what is interrupted here."""
    for instance in (hard(pois=8), hard("B", 8), replace(hard(pois=8), failure="per_leg")):
        plan_stochastic(instance)


def averse(instance: Instance) -> Plan:
    return plan_averse(instance, RiskMeasure(kind="cvar"))


def by(method: Method) -> Callable[[Instance], Plan]:
    return lambda instance: plan_stochastic(instance, method=method)


@pytest.mark.spread(6)
@pytest.mark.parametrize(("where", "name", "instance", "solve"), [
    (heuristic, "run_rounds", hard("B", 150), by("auto")),
    (long_routes, "anneal", hard(pois=150), by("auto")),
    (column_generation, "best_routes", hard(), by("auto")),
    (column_generation, "best_routes", replace(hard(), failure="per_leg"), by("auto")),
    (column_generation, "best_routes", hard(vehicles=4), averse),
    (branch_and_cut, "maximise", hard("B", 30, directed=False), by("expected")),
    (branch_and_cut, "Relaxation", hard("B", 30, directed=False), by("dep")),
    (branch_and_cut, "Relaxation", hard(pois=150, directed=False), by("edge-mip")),
    (edge_program, "Simplex", hard(pois=150, directed=False), by("undirected")),
    (edge_tree, "choose", hard(pois=60, vehicles=4, directed=False), by("undirected")),
    (lshaped, "maximise", hard("B", 30, directed=False), by("lshaped")),
], ids=["heuristic", "annealing", "columns", "along the route", "risk", "directed model", "second stage",
        "edge model by HiGHS", "edge model", "nodes of the edge model", "L-shaped"])
def test_ctrl_c_keeps_the_best_plan_wherever_it_comes(
    where: object, name: str, instance: Instance, solve: Callable[[Instance], Plan], monkeypatch: pytest.MonkeyPatch,
) -> None:
    # The first rounds of the heuristic make a first plan.
    searches = heuristic, long_routes
    at_call(monkeypatch, where, name, number=2 if where in searches else 1)
    if where not in searches:
        for search in searches:
            monkeypatch.setattr(search, "ROUNDS", 20)  # it is not what is interrupted
    plan = solve(instance)
    assert plan.status == "interrupted"
    assert plan.value is not None
    assert plan.bound is not None
    assert 0 < plan.value <= plan.bound < math.inf
    if plan.objective != "cvar":
        assert certify(instance, plan).reasons == ()


def test_ctrl_c_ends_all_solves_of_a_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    at_call(monkeypatch, column_generation, "best_routes")
    monkeypatch.setattr(heuristic, "ROUNDS", 20)
    instance = hard()
    with deferring_ctrl_c():  # as the command line has it
        plans = plan_deterministic(instance, plan_stochastic(instance))
    assert plans.plan.status == plans.stochastic.status == "interrupted"
    assert plans.plan.value is not None
    assert plans.plan.value > 0  # with nothing better, the routes of the first plan


def test_labels_stop_growing_when_ctrl_c_is_pressed_or_time_is_up() -> None:
    # Nothing is charged for, so hardly any label falls to another: millions would grow.
    instance = hard(pois=100)
    vehicle = instance.vehicles[1]
    graph = graph_of(instance, scope_of(instance, vehicle, vehicle.incentives > 0), Discount(survival=0.99))
    n = len(instance.sites)

    def labels(left_s: float) -> Priced:
        return price(graph, np.array(vehicle.incentives), np.zeros(n), 0.0, neighbours(graph, instance.pois),
                     threshold=0.0, compared=None, most_routes=5, most_labels=10**9,
                     cut_duals=cut_duals_of((), np.zeros(0), 0, n), left_s=left_s)

    began = time.process_time()
    assert not labels(0.2).complete
    press_soon()
    with pytest.raises(KeyboardInterrupt), deferring_ctrl_c():
        labels(math.inf)
    assert time.process_time() - began < 60


def test_labels_that_time_is_up_for_are_joined_to_no_proof(monkeypatch: pytest.MonkeyPatch) -> None:
    # Both ends have grown in time: with none left, the join is what is cut short.
    instance = hard(pois=8)
    vehicle = instance.vehicles[1]
    graph = graph_of(instance, scope_of(instance, vehicle, vehicle.incentives > 0), Discount())
    n, clock_s = len(instance.sites), iter((0.0, 0.0, 0.0, 60.0))
    assert not graph.symmetric

    def joined() -> Priced:
        return price(graph, np.array(vehicle.incentives), np.zeros(n), 0.0, neighbours(graph, instance.pois),
                     threshold=0.0, compared=None, most_routes=5, most_labels=10**9,
                     cut_duals=cut_duals_of((), np.zeros(0), 0, n), left_s=59.0)

    assert joined().complete
    monkeypatch.setattr(pricing, "monotonic", lambda: next(clock_s))
    cut_short = joined()
    assert not cut_short.complete
    assert cut_short.labels > 1


def test_compiled_code_is_loaded_in_a_block_that_defers() -> None:
    # Nothing of what it gives back is lost, but it is given back before Ctrl-C comes.
    got = []
    with pytest.raises(KeyboardInterrupt), deferring_ctrl_c():  # noqa: PT012 - what comes after the key is the point
        signal.raise_signal(signal.SIGINT)
        got.append(counts(np.ones((1, 3), np.bool_), np.ones((1, 3), np.bool_), np.ones(1, np.bool_), np.arange(3)))
    assert got[0].tolist() == [1.0]


def test_the_command_line_writes_the_plan_and_ends_with_130(tmp_path: Path) -> None:
    instance, plan = tmp_path / "i.json", tmp_path / "p.json"
    write_instance(instance, hard())
    process = subprocess.Popen([sys.executable, "-m", "sva_bench", "plan", str(instance), "-o", str(plan)],
                               stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    assert process.stderr.readline() == "solving ...\n"
    time.sleep(1.0)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=120)
    assert process.returncode == 130, said
    assert said.startswith("interrupted: value ")
    assert json.loads(plan.read_text(encoding="utf-8"))["status"] == "interrupted"
    assert certify(hard(), read_plan(plan, hard())).reasons == ()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["i.json", "p.json"]


def test_ctrl_c_ends_the_search_for_chains_of_very_many_stations(monkeypatch: pytest.MonkeyPatch) -> None:
    # 600 stations: each of 360 000 pairs of sites has as many ways.
    rng = np.random.default_rng(0)
    at = rng.uniform(0, 100, size=(602, 2))
    fuel = np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1))
    made = hard(pois=2, vehicles=1).vehicles[0]
    instance = Instance(
        name="stations", sites=tuple(f"s{k}" for k in range(602)), base=0, stations=tuple(range(1, 601)),
        stop_s=np.zeros(602), vehicles=(replace(
            made, fuel_capacity_s=150.0, mission_limit_s=1000.0, fuel_s=fuel, incentives=np.eye(602)[601]),))
    at_call(monkeypatch, routes, "_station_chains")
    with pytest.raises(KeyboardInterrupt):
        routes.leg_tables(instance)
