from __future__ import annotations

import json
import pickle
import time
from pathlib import Path
from typing import Any, Literal

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from pydantic import Field

from sva_bench.errors import BadFile, ExitCode, nearest
from sva_bench.files.complaints import dotted
from sva_bench.files.documents import MAX_YAML_BYTES, Loc, parse_yaml, read_json, read_yaml, validate
from sva_bench.files.fields import Bounded, Name, Section
from sva_bench.files.pretty import pretty_json
from sva_bench.files.yaml_text import pretty_yaml
from sva_bench.mission.instance_file import read_instance
from tests.worlds_for_tests import SMALL, world_of


class Part(Section):
    size_m: Bounded
    label: str = "none"


class Whole(Section):
    format: Literal["test/whole@1"]
    name: Name
    part: Part | None = None
    parts: dict[Name, Part] = Field(default_factory=dict)


def yaml(folder: Path, text: str) -> Path:
    path = folder / "file.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def complaint(path: Path) -> BadFile:
    with pytest.raises(BadFile) as caught:
        validate(read_yaml(path), Whole, "test/whole@1")
    return caught.value


def test_a_good_file_gives_its_data(tmp_path: Path) -> None:
    path = yaml(tmp_path, "format: test/whole@1\nname: a\nparts:\n  p.1: {size_m: 2}\n  q: {size_m: 0.5, label: big}\n")
    whole = validate(read_yaml(path), Whole, "test/whole@1")
    assert whole.parts["p.1"].size_m == 2.0
    assert whole.parts["q"].label == "big"


@pytest.mark.parametrize(("text", "line", "key", "says"), [
    ("format: test/whole@1\nname: a\nprat: {size_m: 1}\n", 3, "prat", "did you mean 'part'"),
    ("format: test/whole@1\nname: a\npart:\n  size_m: 1\n  lable: x\n", 5, "part.lable", "did you mean 'label'"),
    ("format: test/whole@1\nname: a\npart:\n  label: x\n", 3, "part.size_m", "is missing; add it"),
    ("format: test/whole@1\nname: a\npart:\n  size_m: -1\n", 4, "part.size_m", "found -1"),
    ("format: test/whole@1\nname: a\npart:\n  size_m: .nan\n", 4, "part.size_m", "finite"),
    ("format: test/whole@1\nname: a\npart:\n  size_m: -.INF\n", 4, "part.size_m", "finite"),
    ("format: test/whole@1\nname: a\npart:\n  size_m: 1e999\n", 4, "part.size_m", "finite"),
    ("format: test/whole@1\nname: a\npart:\n  size_m: '1'\n", 4, "part.size_m",
     "found the text '1': take the quotes away"),
    ("format: test/whole@1\nname: a b\n", 2, "name", "no valid name"),
    ("format: test/whole@1\nname: ../a\n", 2, "name", "no valid name"),
    ("format: test/whole@1\nname: a\nname: b\n", 3, "name", "is a duplicate"),
    ("format: test/whole@2\nname: a\n", 1, "format", "expected 'test/whole@1', found 'test/whole@2'"),
    ("name: a\n", 1, "", "the key 'format' is missing"),
    ("- format\n", 1, "", "expected a mapping"),
    ("", 1, "", "empty"),
    ("# nothing but a remark\n", 1, "", "empty"),
    ("format: test/whole@1\nname: !!python/name:os.system a\n", 2, "name", "tag"),
    ("format: test/whole@1\nname: &n a\npart: *n\n", 3, "", "aliases are not allowed"),
    ("format: test/whole@1\nname: [a\n", 3, "", "not valid YAML"),
    ("format: test/whole@1\nname: a\npart:\n\tsize_m: 1\n", 4, "", "a tab indents this line; write spaces"),
    ("format: test/whole@1\nname: a\npart:\n  label: x\n\tsize_m: 1\n", 5, "", "a tab indents this line; write spaces"),
    ("format: test/whole@1\nname: a\nparts:\n  p:\n  \tsize_m: 1\n", 5, "", "a tab indents this line; write spaces"),
    ("format: test/whole@1\nname: a\n---\nname: b\n", 3, "", "a second document begins here ('---'); a file holds one"),
    ("format: test/whole@1\nname: a\npart:\n  size_m: 0,5\n", 4, "part.size_m",
     "expected a number, found the text '0,5': write a decimal point, 0.5"),
    ("format: test/whole@1\nname: a\npart:\n  size_m: -1,25e3\n", 4, "part.size_m", "write a decimal point, -1.25e3"),
    ("format: test/whole@1\nname: a\npart: {size_m: 0,5}\n", 3, "part.5", "write a decimal point"),
    ("format: test/whole@1\n? [a, b]\n: c\n", 2, "", "a key must be a plain word"),
])
def test_each_complaint_names_line_and_key(tmp_path: Path, text: str, line: int, key: str, says: str) -> None:
    error = complaint(yaml(tmp_path, text))
    assert (error.line, error.key) == (line, key)
    assert says in str(error)
    assert str(error).startswith(f"{tmp_path}/file.yaml:{line}: ")


def test_what_is_no_plain_file_of_text_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match="no such file"):
        read_yaml(tmp_path / "absent.yaml")
    with pytest.raises(BadFile, match="not a file"):
        read_yaml(tmp_path)
    (tmp_path / "binary.yaml").write_bytes(b"\x89PNG\xff\xfe\x00")
    with pytest.raises(BadFile, match="not UTF-8"):
        read_yaml(tmp_path / "binary.yaml")
    (tmp_path / "zeros.yaml").write_bytes(b"name: \x00\x01")
    with pytest.raises(BadFile, match=r"zeros\.yaml"):
        read_yaml(tmp_path / "zeros.yaml")
    (tmp_path / "huge.yaml").write_bytes(b"#" * (MAX_YAML_BYTES + 1))
    with pytest.raises(BadFile, match="at most"):
        read_yaml(tmp_path / "huge.yaml")


@pytest.mark.parametrize("kind", ["PNG", "JPEG", "GIF", "PPM", "BMP", "TIFF"])
def test_an_image_in_place_of_a_document_is_identified_with_a_hint(kind: str, tmp_path: Path) -> None:
    for suffix in (".yaml", ".json"):
        path = (tmp_path / "picture").with_suffix(suffix)
        Image.new("RGB", (40, 30)).save(path, format=kind)
        read = read_yaml if suffix == ".yaml" else read_json
        with pytest.raises(BadFile, match=f"this is a {kind} image, no text: name the YAML file"):
            read(path)


@pytest.mark.parametrize(("text", "at", "says"), [
    ('{"format": "test/whole@1", "name": 5}', "name",
     'expected a word, found the number 5; if it is a name, write "5"'),
    ('{"format": "test/whole@1", "name": true}', "name",
     'expected a word, found true; if it is a name, write "true"'),
    ('{"format": "test/whole@1", "name": 0.5}', "name", 'write "0.5"'),
    ('{"name": "a"}', "", 'add "format": "test/whole@1"'), ("[]", "", 'starts with "format": "test/whole@1"'),
])
def test_advice_about_json_is_json(text: str, at: str, says: str, tmp_path: Path) -> None:
    path = tmp_path / "file.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BadFile) as caught:
        validate(read_json(path), Whole, "test/whole@1")
    assert caught.value.key == at
    assert says in caught.value.problem
    assert "'" not in caught.value.problem.replace("'format'", "")


@pytest.mark.parametrize("text", [
    "a: " + "[" * 40 + "]" * 40, "a: " + "[" * 3000 + "]" * 3000, "a: " + "{b: " * 3000 + "1" + "}" * 3000])
def test_deep_nesting_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(BadFile, match="nested"):
        read_yaml(yaml(tmp_path, text))


def test_an_alias_bomb_is_refused_at_once(tmp_path: Path) -> None:
    # Nine levels of nine would be 400 million words.
    lines = ["a0: &a0 [lol, lol, lol, lol, lol, lol, lol, lol, lol]"]
    lines += [f"a{k}: &a{k} [" + ", ".join([f"*a{k - 1}"] * 9) + "]" for k in range(1, 9)]
    draft_held = time.monotonic()
    with pytest.raises(BadFile, match="aliases are not allowed"):
        read_yaml(yaml(tmp_path, "\n".join(lines)))
    assert time.monotonic() - draft_held < 2  # milliseconds in truth; a slow machine is forgiven


def test_dates_and_words_of_old_yaml_stay_text(tmp_path: Path) -> None:
    # YAML 1.1 would read a country code as false, and a time as a number of base 60.
    data = read_yaml(yaml(tmp_path, "a: no\nb: 12:30\nc: 2020-01-02\nd: 0x10\ne: ~\nf: true\n")).data
    assert data == {"a": "no", "b": "12:30", "c": "2020-01-02", "d": 16, "e": None, "f": True}


@pytest.mark.parametrize(("text", "line", "says"), [
    ('{"a": 1,\n "a": 2}', 2, "is a duplicate"),
    ('{"a": 1,\n "b": NaN}', 2, "NaN is not a number"),
    ('{"a": 1,\n "b": -Infinity}', 2, "-Infinity is not a number"),
    ('{"a": 1,\n "b" 2}', 2, "not valid JSON"),
    ("", 1, "not valid JSON"),
    ("[" * 100_000, None, "nested deeper than 32"),
    ('{"a": ' + "9" * 5000 + "}", None, "not valid JSON"),
])
def test_json_has_the_same_rules(tmp_path: Path, text: str, line: int | None, says: str) -> None:
    path = tmp_path / "file.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BadFile, match=says) as caught:
        read_json(path)
    assert caught.value.line == line


def test_json_knows_the_lines_of_its_keys(tmp_path: Path) -> None:
    path = tmp_path / "file.json"
    path.write_text('{"format": "test/whole@1", "name": "a",\n "parts": {"p": {"size_m": 1},\n'
                    '           "q": {"size_m": "x"}}}', encoding="utf-8")
    with pytest.raises(BadFile) as caught:
        validate(read_json(path), Whole, "test/whole@1")
    assert (caught.value.line, caught.value.key) == (3, "parts.q.size_m")


def test_an_error_survives_pickling_from_a_worker() -> None:
    error = BadFile("a.yaml", 3, "sites.base", "wrong")
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == str(error) == "a.yaml:3: sites.base: wrong"
    assert again.exit_code == ExitCode.BAD_INPUT


def test_a_hint_names_the_nearest_word_or_all_of_them() -> None:
    assert nearest("sitse", ["sites", "robots"]) == "did you mean 'sites'?"
    assert nearest("xyz", ["b", "a"]) == "known: a, b"
    assert nearest("xyz", []) == "none is defined"


def test_a_place_is_written_with_dots_and_brackets() -> None:
    assert dotted(("map", "obstacles", 2, "box", 0)) == "map.obstacles[2].box[0]"
    assert dotted(()) == ""


plain = st.recursive(
    st.none() | st.booleans() | st.integers(-2**53, 2**53) | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=30),
    lambda inner: st.lists(inner, max_size=8) | st.dictionaries(st.text(max_size=8), inner, max_size=8), max_leaves=60)


@given(plain)
def test_pretty_json_means_what_plain_json_means(data: Any) -> None:
    text = pretty_json(data)
    assert json.loads(text) == data
    assert text.endswith("\n")


def test_pretty_json_keeps_rows_on_their_lines_and_refuses_nan() -> None:
    assert pretty_json({"a": [1, 2], "b": {}}) == '{"a": [1, 2], "b": {}}\n'
    matrix = [[float(i * j) for j in range(12)] for i in range(12)]
    assert pretty_json({"fuel_s": matrix}).count("\n") == 16  # a row a line, and two brackets each for list and dict
    with pytest.raises(ValueError, match="not JSON compliant"):
        pretty_json({"a": float("nan")})


names = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,8}", fullmatch=True) | st.sampled_from(["null", "true", "1e5"])
leaves = st.booleans() | st.none() | st.integers(-10**6, 10**6) | names | st.floats(-1e9, 1e9)
nested = st.recursive(leaves, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(names, inner, max_size=8),
                      max_leaves=12)


@settings(max_examples=50)
@given(st.dictionaries(names, nested, min_size=1, max_size=4))
def test_pretty_yaml_reads_as_what_it_was_made_of(data: dict[str, Any]) -> None:
    remarks: dict[Loc, str] = {(): "what this is", **{(key,): "\nabove" for key in data}}
    text = pretty_yaml(data, remarks)
    assert parse_yaml(text, Path("made.yaml")).data == data
    assert text.startswith("# what this is\n")
    assert not any(line != line.rstrip() for line in text.split("\n"))


def test_pretty_yaml_puts_what_holds_no_mapping_on_a_line_and_remarks_above_it() -> None:
    data = {"map": {"shapes": [{"wall": [[0, 1], [2.5, 1]]}, {"post": [3, 4]}]}, "part": {"size_m": 2, "sub": {}}}
    assert pretty_yaml(data, {(): "a map", ("map", "shapes", 1): "posts", ("part",): "\n"}) == (
        "# a map\nmap:\n  shapes:\n    - {wall: [[0, 1], [2.5, 1]]}\n    # posts\n    - {post: [3, 4]}\n\n"
        "part:\n  size_m: 2\n  sub: {}\n")


@pytest.mark.parametrize(("written", "kind"), [
    ("2024", "a number"), ("1e3", "a number"), ("0x10", "a number"), ("true", "a truth value"), ("null", "nothing"),
])
def test_a_name_that_yaml_reads_as_another_type_gets_a_hint_at_quotes(
        written: str, kind: str, tmp_path: Path) -> None:
    said = f"expected a word, and {written} without quotes is {kind}; if it is a name, write '{written}'"
    for at, text in (("name", SMALL.replace("name: small", f"name: {written}")),
                     ("robots.uv1.model", SMALL.replace("model: turtlebot2", f"model: {written}", 1)),
                     ("scenarios.half.joint[0].available[0]", SMALL.replace(
                         "half: {uv2: 0.5}", f"half: {{joint: [{{probability: 1.0, available: [{written}]}}]}}"))):
        with pytest.raises(BadFile) as refused:
            world_of(tmp_path, text)
        assert (refused.value.key, refused.value.problem) == (at, said)
    quoted = SMALL.replace("name: small", f"name: '{written}'").replace("p1", f"'{written}'").replace("uv1", "1e3")
    assert world_of(tmp_path, quoted).name == written


def test_a_missing_name_gets_no_hint_at_quotes(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match="name: expected a word, found nothing"):
        world_of(tmp_path, SMALL.replace("name: small", "name:"))


def test_a_number_of_any_length_in_place_of_a_word_is_a_short_complaint(tmp_path: Path) -> None:
    path = tmp_path / "instance.json"
    path.write_text('{"format": "sva-bench/instance@1",\n "name": 1' + "0" * 600 + "}")
    with pytest.raises(BadFile) as told:
        read_instance(path)
    assert "..." in str(told.value)
    assert len(str(told.value)) < 300 + len(str(path))
