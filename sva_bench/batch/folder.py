"""The folder of a batch: one writer at a time by a kernel lock, and atomically written files."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import json
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

from sva_bench.analysis.over_maps import GivenUp
from sva_bench.batch.schema import FAILURES, MANIFEST, BatchManifest, BatchSettings, GivenUpUnits
from sva_bench.errors import BadFile, BadInput
from sva_bench.files.atomic import by_way_of, reason_of
from sva_bench.files.documents import read_json, validate
from sva_bench.files.pretty import pretty_json
from sva_bench.files.read_back import MOST_BYTES, Part, read_ours
from sva_bench.files.records import as_dict


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """A block that holds the lock of a batch folder. It is a kernel lock on the folder, and ends with the process.

    Raises:
        BadInput: If the folder cannot be created or opened, or another batch holds the lock.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        raise _unwritable(folder, error) from None
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise BadInput(f"{folder}: another batch is at work in this folder; wait for it, or choose another with "
                           "--out") from None
        yield
    finally:
        os.close(handle)


def at_work(folder: Path) -> bool:
    """Whether a batch is running in a folder."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(handle)
    return False


def begin(folder: Path, settings: BatchSettings, *, resume: bool) -> None:
    """Prepare a locked folder for a batch of these settings.

    Raises:
        BadInput: If it holds something else, or cannot be written to.
    """
    try:
        stored = [path for path in folder.iterdir() if path.suffix != ".tmp"]
        manifest = folder / "manifest.json"
        if not resume and manifest in stored and not units_in(folder) and settings_in(folder) \
                and not any((folder / name).exists() for name in ("failures.json", "summary.json")):
            stored = []  # begun, but nothing was done
        if stored and not resume:
            raise BadInput(f"{folder}: the folder isn't empty; go on with --resume, or choose another with --out")
        if stored:
            refuse_other_settings(folder, settings)
        for draft in folder.glob("*.tmp"):
            draft.unlink()
    except OSError as error:
        raise _unwritable(folder, error) from None
    if not stored:
        command = ("sva-bench", *sys.argv[1:])
        content = pretty_json(as_dict(BatchManifest(settings=settings, command=command))).encode()
        if len(content) > MOST_BYTES:
            raise BadInput(f"the worlds and variants of this batch take {len(content)} bytes; at most {MOST_BYTES} are "
                           "kept in one folder: cut it into several batches")
        write(manifest, content)


def settings_in(folder: Path) -> tuple[Part, BatchSettings]:
    """The settings of a batch folder, as read and as validated.

    Raises:
        BadInput: If it is no batch folder.
        BadFile: If its manifest is invalid.
    """
    path = folder / "manifest.json"
    if not path.exists():
        raise BadInput(f"{folder}: no folder of a batch (manifest.json is missing); choose another")
    document = read_json(path, MOST_BYTES)
    if isinstance(document.data, dict) and document.data.get("format") == "sva-bench/manifest@1":
        raise BadInput(f"{folder}: the folder of a run, not of a batch; 'sva-bench report' with this folder writes its "
                       "report again")
    settings = validate(document, BatchManifest, MANIFEST).settings
    return Part(document, ("settings",), document.data["settings"]), settings


def command_in(folder: Path) -> tuple[str, ...]:
    """The command line that began a batch; nothing in older folders.

    Raises:
        BadFile: If its manifest is invalid.
    """
    return validate(read_json(folder / "manifest.json", MOST_BYTES), BatchManifest, MANIFEST).command


def is_batch(folder: Path) -> bool:
    """Whether a folder is that of a batch, by its manifest."""
    path = folder / "manifest.json"
    data = read_json(path, MOST_BYTES).data if path.is_file() else None
    return isinstance(data, dict) and data.get("format") == MANIFEST


def refuse_other_settings(folder: Path, settings: BatchSettings) -> None:
    """Refuse to resume a batch with other settings; the message names the differences.

    Raises:
        BadFile: If the settings differ.
    """
    stored, now = settings_in(folder)[0].data, json.loads(json.dumps(as_dict(settings)))
    for name, point in stored["points"].items():
        if "settings" not in point:  # of an older folder, whose variants say the same in their names
            now["points"].get(name, {}).pop("settings", None)
    differences = list(islice(_differences(stored, now), _MOST_NAMED + 1))
    if not differences:
        return
    named = [f"{key} ({_shown(was)} there, {_shown(is_now)} now)" for key, was, is_now in differences[:_MOST_NAMED]]
    more = ["and more"] if len(differences) > _MOST_NAMED else []
    raise BadFile(folder / "manifest.json", None, "settings", "not those of the batch in this folder: "
                  f"{', '.join([*named, *more])}; use the same settings, or choose another folder with --out")


_ABSENT = object()
_MOST_NAMED = 12


def _differences(stored: Any, now: Any, key: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Each key at which two settings differ, and both values."""
    if isinstance(stored, dict) and isinstance(now, dict):
        for name in [*stored, *(name for name in now if name not in stored)]:
            yield from _differences(stored.get(name, _ABSENT), now.get(name, _ABSENT), f"{key}.{name}" if key else name)
    elif isinstance(stored, list) and isinstance(now, list) and len(stored) == len(now) and \
            any(isinstance(item, dict | list) for item in [*stored, *now]):
        for number, (one, other) in enumerate(zip(stored, now, strict=True)):
            yield from _differences(one, other, f"{key}[{number}]")
    elif stored is _ABSENT or now is _ABSENT or stored != now:
        yield key, stored, now


def _shown(value: Any) -> str:
    if value is _ABSENT:
        return "absent"
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def shard_path(folder: Path, unit: str) -> Path:
    """Path of a unit's shard."""
    return folder / f"outcomes-{unit}.parquet"


def units_in(folder: Path) -> set[str]:
    """Names of the completed units."""
    return {path.stem.removeprefix("outcomes-") for path in folder.glob("outcomes-*.parquet")}


def failures_in(folder: Path) -> list[GivenUp]:
    """The units that failed for good."""
    path = folder / "failures.json"
    if not path.exists():
        return []
    return list(read_ours(path, GivenUpUnits, FAILURES)[1].failures)


def write_failures(folder: Path, failures: Sequence[GivenUp]) -> None:
    """Write the list of units that failed for good."""
    write(folder / "failures.json", pretty_json(as_dict(GivenUpUnits(failures=tuple(failures)))).encode())


def write_maps(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write the files of maps into a batch folder, unless they exist: resuming needs no other files."""
    for name, content in files.items():
        path = folder / name
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            stored = path.exists() and path.read_bytes() == content
        except OSError as error:
            raise _unwritable(path, error) from None
        if not stored:
            write(path, content)


def write(path: Path, content: bytes) -> None:
    """Write a file of a batch folder atomically, and sync it to disk.

    Raises:
        BadInput: If it cannot be written; what was written before stays.
    """
    with writing(path) as draft:
        draft.write_bytes(content)


@contextlib.contextmanager
def writing(path: Path) -> Iterator[Path]:
    """A draft of a file of a batch folder, which replaces it when the block ends.

    Raises:
        BadInput: If it cannot be written; what was written before stays.
    """
    draft = path.with_name(f"{path.name}.tmp")
    try:
        with by_way_of(draft, path):
            yield draft
    except OSError as error:
        raise _unwritable(path, error) from None


def _unwritable(place: Path, error: OSError) -> BadInput:
    way_out = "make room and go on with --resume" if error.errno in (errno.ENOSPC, errno.EDQUOT) else \
        "make it writable and go on with --resume"
    return BadInput(f"{place}: cannot be written to ({reason_of(error)}); what is done is kept: {way_out}, or choose "
                    "another folder with --out")
