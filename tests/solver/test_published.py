"""The runners of published instances, on tiny files that the tests write."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from benchmarks.solver.chao import PATTERNS, read_chao
from benchmarks.solver.oplib import COSTS, read_oplib
from benchmarks.solver.published import NotServed, best_values, main, summary
from sva_bench.solver.two_stage import plan_stochastic

# Start and end 2 apart; a POI on the way, and one far away.
CHAO = "n 4\nm 1\ntmax 4.0\n0.0\t0.0\t0\n1.0\t0.0\t5\n0.0\t9.0\t7\n2.0\t0.0\t0\n"
OPLIB = """NAME : tiny-gen1
TYPE : OP
DIMENSION : 4
COST_LIMIT : 10
EDGE_WEIGHT_TYPE : EUC_2D
NODE_COORD_SECTION
1 0.0 0.0
2 3.4 0.0
3 3.4 1.2
4 50.0 50.0
NODE_SCORE_SECTION
1 0
2 1
3 4
4 9
DEPOT_SECTION
1
-1
EOF
"""


def written(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_legs_from_the_base_are_those_from_the_start_and_legs_to_it_those_to_the_end(tmp_path: Path) -> None:
    instance = read_chao(written(tmp_path / "p9.1.a.txt", CHAO))
    assert instance.sites == ("base", "p1", "p2")
    assert_allclose(instance.vehicles[0].fuel_s, [[0, 1, 9], [1, 0, 82**0.5], [85**0.5, 82**0.5, 0]])
    assert_array_equal(instance.vehicles[0].incentives, [0, 5, 7])
    assert plan_stochastic(instance).value == 5.0  # start, (1, 0), end: 2 of 4


@pytest.mark.parametrize(("text", "complaint"), [
    ("n 3\nm 1\ntmax 4\n0 0 0\n1 0 5\n", "expected 3 lines x y score for start, POIs and end, found 2"),
    ("m 1\nn 2\ntmax 4\n0 0 0\n1 0 0\n", "expected the lines n, m and tmax"),
    ("n 2\nm one\ntmax 4\n0 0 0\n1 0 0\n", "one"),
    ("n\nm 1\ntmax 4\n0 0 0\n1 0 0\n", "index"),
    ("", "expected the lines n, m and tmax"),
])
def test_a_broken_file_of_chaos_is_refused_with_the_reason(tmp_path: Path, text: str, complaint: str) -> None:
    with pytest.raises(NotServed, match=complaint):
        read_chao(written(tmp_path / "p9.1.a.txt", text))


def test_costs_of_oplib_are_rounded_as_tsplib_says(tmp_path: Path) -> None:
    # 3.4 -> 3, 3.606 -> 4, 1.2 -> 1: over both near POIs 3 + 1 + 4 = 8 of 10.
    instance = read_oplib(written(tmp_path / "tiny-gen1.oplib", OPLIB))
    assert_array_equal(instance.vehicles[0].fuel_s[:3, :3], [[0, 3, 4], [3, 0, 1], [4, 1, 0]])
    assert instance.vehicles[0].mission_limit_s == 10.0
    assert plan_stochastic(instance).value == 5.0


def test_the_other_costs_of_tsplib_are_as_computed_by_hand() -> None:
    at = np.array([[0.0, 0.0], [3.0, 1.0]])  # 3.1623 apart
    assert COSTS["CEIL_2D"](at)[0, 1] == 4.0
    # Divided by sqrt(10): 2.2 and 2.6 become 3, for what is rounded down is raised by 1.
    assert COSTS["ATT"](2.2 * at)[0, 1] == COSTS["ATT"](2.6 * at)[0, 1] == 3.0
    # A quarter of the equator: 6378.388 x 3.141592 / 2 = 10019.15, plus 1, rounded down.
    assert COSTS["GEO"](np.array([[0.0, 0.0], [0.0, 90.0]]))[0, 1] == 10020.0
    # 0.30 is 30 minutes: 6378.388 x 3.141592 / 360 = 55.66, plus 1, rounded down.
    assert COSTS["GEO"](np.array([[0.0, 0.0], [0.0, 0.30]]))[0, 1] == 56.0


@pytest.mark.parametrize(("old", "new", "complaint"), [
    ("EUC_2D", "EXPLICIT", "costs of the type EXPLICIT"),
    ("COST_LIMIT : 10\n", "", "no COST_LIMIT$"),
    ("COST_LIMIT : 10", "COST_LIMIT : nan", "a COST_LIMIT of 0 or more, found nan"),
    ("NODE_SCORE_SECTION\n", "", "no NODE_SCORE_SECTION"),
    ("3 4\n", "3 nan\n", "node 3: expected finite numbers"),
    ("2 3.4 0.0", "2 inf 0.0", "node 2: expected finite numbers"),
    ("2 3.4 0.0", "2 3.4", "ends too soon"),
    ("2 1\n", "2 many\n", "could not convert string to float: 'many'"),
    ("DIMENSION : 4", "DIMENSION : 5", "DIMENSION 5, but 4 nodes"),
    ("3 4\n4 9\n", "3 4\n", "node 4 has no score"),
    ("DEPOT_SECTION\n1\n", "DEPOT_SECTION\n7\n", "the depot 7 has no coordinates"),
])
def test_a_broken_file_of_oplib_is_refused_with_the_reason(tmp_path: Path, old: str, new: str, complaint: str) -> None:
    assert old in OPLIB
    with pytest.raises(NotServed, match=complaint):
        read_oplib(written(tmp_path / "tiny-gen1.oplib", OPLIB.replace(old, new)))


def test_a_run_goes_on_where_it_ended_and_compares_with_the_published_best(
    tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    for name in ("p9.1.a", "p9.1.b"):
        written(tmp_path / f"{name}.txt", CHAO)
    written(tmp_path / "p9.1.c.txt", CHAO.replace("n 4", "n 5"))
    written(tmp_path / "best.csv", "instance,best\np9.1.a,5\np9.1.b,8\n")
    out = tmp_path / "results.csv"
    arguments = ["--data", str(tmp_path), "--out", str(out), "--time-limit", "30", "--limit"]
    main("", PATTERNS, read_chao, [*arguments, "1"])
    (first,) = rows_of(out)
    assert {**first, "cpu_s": ""} == {
        "instance": "p9.1.a", "pois": "2", "vehicles": "1", "cpu_s": "", "proved": "yes", "value": "5", "bound": "5",
        "best": "5", "off_pct": "0.000", "note": ""}
    assert float(first["cpu_s"]) >= 0
    main("", PATTERNS, read_chao, [*arguments, "9"])
    rows = rows_of(out)
    assert rows[0] == first
    assert [row["instance"] for row in rows] == ["p9.1.a", "p9.1.b", "p9.1.c"]
    assert rows[1]["off_pct"] == "37.500"
    assert rows[2]["note"].startswith("skipped: p9.1.c.txt: expected 5 lines")
    assert "2 proved, 1 of 2 with a published best reach it; 1 skipped" in summary(rows)
    assert "1 skipped" in capsys.readouterr().out


def test_folders_without_instances_and_tables_of_other_columns_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    assert best_values(tmp_path) == {}
    for folder, complaint in ((tmp_path, "no file named"), (tmp_path / "none", "no such folder")):
        with pytest.raises(SystemExit):
            main("", PATTERNS, read_chao, ["--data", str(folder)])
        assert complaint in capsys.readouterr().err
    written(tmp_path / "best.csv", "name;value\n")
    with pytest.raises(ValueError, match="expected the columns instance and best"):
        best_values(tmp_path)
    (tmp_path / "best.csv").unlink()
    written(tmp_path / "optima.json", '{"p1.2.b": {"best": 15.0, "proved": true}}')
    assert best_values(tmp_path) == {"p1.2.b": 15.0}
