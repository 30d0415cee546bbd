"""Tables on disk: one schema for each, written by pieces, and read by pieces, checked and within bounds.

A Parquet file of a few hundred kilobytes can unpack to any size, so nothing of one is taken on trust: not its columns,
not how many rows it has, and not how much memory those take.
"""

from __future__ import annotations

import contextlib
import resource
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pcsv
import pyarrow.parquet as pq

from sva_bench.errors import BadFile
from sva_bench.files.printable import counted

MOST_ROWS = 200_000_000
"""Rows of a table that are read: ten million trials of two plans by two robots in five scenarios."""
MOST_BYTES = 1 << 29
"""Bytes that a column of a row group, and all that is held at a time, may unpack to."""
MOST_NOTE_BYTES = 10_000_000
_AGAIN = "run the command in manifest.json again"
_BATCH = 1 << 13  # rows: with eight times as many, a report takes a fifth more memory and is no faster

_WORD, _COUNT, _FIGURE = pa.string(), pa.int64(), pa.float64()


def _schema(columns: Mapping[str, tuple[pa.DataType, str]]) -> pa.Schema:
    """A schema whose columns have their units in their metadata; ``1`` is a count or a number in order."""
    return pa.schema([pa.field(name, kind, metadata={"unit": unit} if unit else None)
                      for name, (kind, unit) in columns.items()])


OUTCOMES = _schema({
    "scenario": (_WORD, ""), "planner": (_WORD, ""), "policy": (_WORD, ""), "news": (_WORD, ""),
    "trial": (_COUNT, "1"), "rollout": (_COUNT, "1"), "history": (_COUNT, "1"), "weight": (_FIGURE, "1"),
    "robot": (_WORD, ""), "available": (pa.bool_(), ""),
    "incentive": (_FIGURE, "incentive of the world file"), "lost": (pa.bool_(), ""),
    "value": (_FIGURE, "incentive of the world file"), "pois_reached": (_COUNT, "1"), "stops_reached": (_COUNT, "1"),
    "end": (_WORD, ""), "end_time_s": (_FIGURE, "s"), "fuel_used_s": (_FIGURE, "s of driving"),
    "waited_s": (_FIGURE, "s"), "contacts": (_COUNT, "1"), "fidelity": (_WORD, "")})
"""A row per scenario, plan, reaction, trial and robot: of runs and, with what they belong to, of batches.

Where histories of failures are enumerated, each under each noise draw is a trial, ``history`` is its number there and
``weight`` its probability, which add up to 1. Where they are sampled, these are -1 and 1. So means are weighted.
"""

SHARDS = pa.schema([*OUTCOMES, pa.field("world", _WORD), pa.field("seed", _COUNT), pa.field("variant", _WORD)])

LEGS = _schema({
    "scenario": (_WORD, ""), "planner": (_WORD, ""), "policy": (_WORD, ""), "news": (_WORD, ""),
    "trial": (_COUNT, "1"), "rollout": (_COUNT, "1"), "robot": (_WORD, ""), "leg": (_COUNT, "1"),
    "origin": (_WORD, ""), "destination": (_WORD, ""), "planned_s": (_FIGURE, "s"), "driven_s": (_FIGURE, "s"),
    "waited_s": (_FIGURE, "s"), "cut_short": (pa.bool_(), "")})
"""A row per leg driven, with the first trial that it belongs to; of those cut short, what was driven of them."""

_MET = {"scenario": (_WORD, ""), "planner": (_WORD, ""), "policy": (_WORD, ""), "news": (_WORD, ""),
        "trial": (_COUNT, "1"), "rollout": (_COUNT, "1"), "robot": (_WORD, ""), "leg": (_COUNT, "1"),
        "origin": (_WORD, ""), "destination": (_WORD, ""), "since_s": (_FIGURE, "s of driving since the leg began"),
        "lasts_s": (_FIGURE, "s"), "x_m": (_FIGURE, "m"), "y_m": (_FIGURE, "m")}

CONTACTS = _schema({**_MET, "solid": (_WORD, ""), "stuck": (pa.bool_(), "")})
"""A row each time that a hull came to touch an obstacle, or another robot, on a leg of ``LEGS``; written where there is
any."""

WAITS = _schema({**_MET, "cause": (_WORD, "")})
"""A row for each wait on a leg of ``LEGS``, for a passage, people or another robot; written where there is any."""

PATHS = _schema({"model": (_WORD, ""), "origin": (_WORD, ""), "destination": (_WORD, ""), "point": (_COUNT, "1"),
                 "x_m": (_FIGURE, "m"), "y_m": (_FIGURE, "m")})
"""The planned paths of legs of ``LEGS`` and of plans, point by point, to a centimetre; ``model`` as in
``TRAVEL_TIMES``."""

TRAVEL_TIMES = _schema({
    "origin": (_WORD, ""), "destination": (_WORD, ""), "model": (_WORD, ""), "raw_s": (_FIGURE, "s"),
    "repaired_s": (_FIGURE, "s"), "via": (_WORD, "")})
"""A row per robot model, or per robot where robots meet, and directed pair of sites."""


def write_table(target: Path | pa.BufferOutputStream, schema: pa.Schema, pieces: Iterable[pa.Table]) -> None:
    """Write a table, piece by piece."""
    # Arrow opens no file whose name is no UTF-8, so all files are opened here.
    with contextlib.ExitStack() as stack:
        sink = stack.enter_context(target.open("wb")) if isinstance(target, Path) else target
        with pq.ParquetWriter(sink, schema) as writer:
            for piece in pieces:
                writer.write_table(piece.cast(schema))


def pieces_of(
    path: Path, schema: pa.Schema, *, rows: int | None = None, most: int = MOST_ROWS,
    words: Mapping[str, frozenset[str]] | None = None,
) -> Iterator[pa.Table]:
    """The pieces of a table of ours, one after the other; words are dictionary-encoded.

    Args:
        path: The file.
        schema: Its columns; others beside them are left out.
        rows: How many rows it must have.
        most: How many it may have.
        words: What a column of words may hold, by its name.

    Raises:
        BadFile: If it is none, is cut off, holds other columns, types, words or numbers of rows, holds NaN or nulls,
            or unpacks to more memory than any of ours.
    """
    spelt = [field.name for field in schema if pa.types.is_string(field.type)]
    with _memory_bounded(), contextlib.ExitStack() as stack:
        with _said_of(path, _AGAIN):
            if not path.is_file():
                raise BadFile(path, None, "", f"no table of ours: no file is there; {_AGAIN}")
            source = stack.enter_context(path.open("rb"))
            _check_head(path, pq.ParquetFile(source), schema, rows, most)
            batches = pq.ParquetFile(source, read_dictionary=spelt).iter_batches(
                _BATCH, columns=schema.names, use_threads=False)
        while True:
            with _said_of(path, _AGAIN):
                batch = next(batches, None)
                if batch is None:
                    return
                _check(path, batch, schema, words or {})
            yield pa.Table.from_batches([batch]).select(schema.names)


@contextlib.contextmanager
def _said_of(path: Path, remedy: str) -> Iterator[None]:
    """What Arrow cannot read, or finds no memory for, is a complaint about the file."""
    try:
        yield
    except MemoryError:
        raise BadFile(path, None, "", f"unpacks to more than {MOST_BYTES} bytes; {remedy}") from None
    except (OSError, ValueError, pa.ArrowException) as error:
        said = (str(error).splitlines() or [type(error).__name__])[0][:120]
        raise BadFile(path, None, "", f"no table of ours, or cut off ({said}); {remedy}") from None


def _check_head(path: Path, file: pq.ParquetFile, schema: pa.Schema, rows: int | None, most: int) -> None:
    head = file.metadata
    names = file.schema_arrow.names
    for field in schema:
        if names.count(field.name) != 1:
            problem = "this column is missing" if field.name not in names else "this column stands twice"
            raise BadFile(path, None, field.name, f"{problem}; {_AGAIN}")
        found = file.schema_arrow.field(field.name).type
        if found != field.type:
            raise BadFile(path, None, field.name, f"expected a column of type {field.type}, found {found}; {_AGAIN}")
    if rows is not None and head.num_rows != rows:
        raise BadFile(path, None, "", f"{counted(head.num_rows, 'row')}, where {rows} belong; {_AGAIN}")
    if head.num_rows > most:
        raise BadFile(path, None, "", f"{head.num_rows} rows; at most {most} are read")
    groups = [head.row_group(number) for number in range(head.num_row_groups)]
    largest = max((group.column(k).total_uncompressed_size for group in groups for k in range(group.num_columns)),
                  default=0)
    if largest > MOST_BYTES:
        raise BadFile(path, None, "", f"a column of it unpacks to {largest} bytes; at most {MOST_BYTES} are read")


def _check(path: Path, batch: pa.RecordBatch, schema: pa.Schema, words: Mapping[str, frozenset[str]]) -> None:
    batch.validate(full=True)
    for field in schema:
        column, name = batch.column(field.name), field.name
        if column.null_count:
            raise BadFile(path, None, name, f"holds nothing in some rows; {_AGAIN}")
        if pa.types.is_floating(field.type) and not pc.all(pc.is_finite(column), min_count=0).as_py():
            raise BadFile(path, None, name, f"holds what is no number; {_AGAIN}")
        if name in words:
            strange = set(pc.unique(column).dictionary_decode().to_pylist()) - words[name]
            if strange:
                raise BadFile(path, None, name, f"{min(strange)[:60]!r} is unknown to this run; {_AGAIN}")


def read_note_of(path: Path, key: bytes) -> bytes:
    """What a table's metadata hold under a key.

    Raises:
        BadFile: If it is no table, or holds nothing there, or too much.
    """
    remedy = "remove it and --resume"
    with _memory_bounded(), _said_of(path, remedy):
        note: bytes | None = None
        if path.is_file():
            with path.open("rb") as source:
                note = (pq.read_schema(source).metadata or {}).get(key)
    if note is None or len(note) > MOST_NOTE_BYTES:
        raise BadFile(path, None, "", f"no shard of a batch (its tally is missing, or too long); {remedy}")
    return note


def write_csv(path: Path, target: Path, schema: pa.Schema) -> None:
    """Write a table of ours as CSV too, piece by piece."""
    bare = pa.schema([pa.field(field.name, field.type) for field in schema])
    with target.open("wb") as sink, pcsv.CSVWriter(sink, bare) as writer:
        for piece in pieces_of(path, schema):
            writer.write_table(piece.cast(bare))


@contextlib.contextmanager
def _memory_bounded() -> Iterator[None]:
    """This process may write to so much memory more: a page of a table can unpack to other than what its head says."""
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    try:
        pages = Path("/proc/self/statm").read_text(encoding="ascii").split()[5]
    except OSError:  # no such kernel: the heads of tables must do
        yield
        return
    most = int(pages) * resource.getpagesize() + MOST_BYTES
    limits = [limit for limit in (soft, hard, most) if limit != resource.RLIM_INFINITY]
    resource.setrlimit(resource.RLIMIT_DATA, (min(limits), hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))
