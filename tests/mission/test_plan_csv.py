"""Plans as CSV: what is read, written back, and refused with line and column."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sva_bench.errors import BadFile
from sva_bench.mission.instance import Instance
from sva_bench.mission.instance_file import read_instance
from sva_bench.mission.plan import Plan
from sva_bench.mission.plan_csv import routes_as_csv
from sva_bench.mission.plan_file import plan_text, read_plan

TINY = """{"format": "sva-bench/instance@1", "name": "tiny", "sites": ["base", "r1", "p1", "p2"], "base": "base",
 "stations": ["r1"], "fuel_s": [[0, 5, 4, 7], [5, 0, 3, 3], [4, 3, 0, 6], [7, 3, 6, 0]],
 "vehicles": [{"name": "uv1", "fuel_capacity_s": 12, "mission_limit_s": 30, "availability": 1.0,
   "incentives": {"p1": 10, "p2": 4}},
  {"name": "uv2", "fuel_capacity_s": 12, "mission_limit_s": 30, "availability": 1.0, "incentives": {"p1": 1}}]}"""


@pytest.fixture(scope="module")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> Instance:
    path = tmp_path_factory.mktemp("instance") / "tiny.json"
    path.write_text(TINY)
    return read_instance(path)


def read(tmp_path: Path, content: str | bytes, tiny: Instance) -> Plan:
    path = tmp_path / "plan.CSV"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_plan(path, tiny)


@pytest.mark.parametrize("content", [
    "robot,stop,site\nuv1,0,base\nuv1,1,p1\nuv1,2,base\n",
    "site,stop,robot\r\nbase,2,uv1\r\np1,1,uv1\r\nbase,0,uv1\r\n",  # rows and columns in any order
    "\ufeffrobot;stop;site\nuv1;0;base\n\nuv1;10;p1\nuv1;20;base",  # as spreadsheets write it; numbers with gaps
    'robot, stop, site\n"uv1", 0, base\nuv1 ,1, p1\nuv1,2,base\n',
])
def test_routes_are_read_however_a_table_is_written(tmp_path: Path, tiny: Instance, content: str) -> None:
    assert dict(read(tmp_path, content, tiny).routes) == {"uv1": ("base", "p1", "base")}


def test_a_robot_with_the_base_alone_stays_home(tmp_path: Path, tiny: Instance) -> None:
    assert dict(read(tmp_path, "robot,stop,site\nuv2,0,base\n", tiny).routes) == {"uv2": ()}


@pytest.mark.parametrize(("content", "said"), [
    ("", "1: expected the columns robot, stop, site, found nothing"),
    ("robot,site\n", "1: expected the columns robot, stop, site, found robot, site"),
    ('{"format": "sva-bench/plan@1"}', "expected the columns"),
    ("robot,stop,site\nuv1,0,base\nuv1,1\n", "3: expected robot, stop and site, found 2 columns"),
    ("robot,stop,site\nuv1,first,base\n", "2: stop: expected the number of a stop, such as 0, found 'first'"),
    ("robot,stop,site\nuv1,-1,base\n", "2: stop: expected the number of a stop"),
    ("robot,stop,site\nuv1,1,base\nuv1,1,p1\n", "3: stop: uv1 has stop 1 already, in line 2"),
    ("robot,stop,site\nuv1,0,base\nuv3,0,base\n", "3: robot: there is no vehicle 'uv3'; did you mean 'uv2'?"),
    ("robot,stop,site\nuv1,0,base\nuv1,1,p9\n", "3: site: there is no site 'p9'"),
    ('robot,stop,site\nuv1,0,"base\n', "no table"),
    (b"robot,stop,site\nuv1,0,b\xff\n", "not UTF-8"),
    (b"robot,stop,site\n" + b"uv1,0,base\n" * 2_000_000, "larger than 20000000 bytes"),
    ("robot,stop,site\n" + "".join(f"uv1,{k},p1\n" for k in range(10_001)), "10001 stops; at most 10000"),
])
def test_what_is_no_table_of_routes_is_refused_with_its_line(
        tmp_path: Path, tiny: Instance, content: str | bytes, said: str) -> None:
    with pytest.raises(BadFile) as error:
        read(tmp_path, content, tiny)
    assert said in str(error.value)


routes = st.dictionaries(st.sampled_from(["uv1", "uv2"]), st.lists(st.sampled_from(["base", "r1", "p1", "p2"]),
                                                                   min_size=3, max_size=9).map(tuple))


@given(routes)
def test_what_is_written_is_read_again(tmp_path_factory: pytest.TempPathFactory, tiny: Instance,
                                       routes: dict[str, tuple[str, ...]]) -> None:
    path = tmp_path_factory.mktemp("plan") / "plan.csv"
    path.write_text(plan_text(Plan(routes=routes), path), encoding="utf-8")
    assert dict(read_plan(path, tiny).routes) == routes
    assert path.read_text(encoding="utf-8") == routes_as_csv(routes)
