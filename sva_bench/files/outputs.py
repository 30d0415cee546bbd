"""Destinations of results: checked before any work, and written atomically."""

from __future__ import annotations

import errno
import os
import sys
from pathlib import Path

from sva_bench.errors import BadInput
from sva_bench.files.atomic import reason_of, try_out, write_file
from sva_bench.files.streams import CLOSED, output_is_closed

ANOTHER_PLACE = "choose another place with -o"


def is_standard_output(path: Path | None) -> bool:
    """Whether a result goes to standard output: no path is given, or ``-``."""
    return path is None or str(path) == "-"


def check_output(path: Path | None, *sources: Path, way_out: str = ANOTHER_PLACE) -> None:
    """Check that a result can be written to a path, and would not overwrite its sources.

    Args:
        path: The file; ``None`` = standard output.
        sources: Files that the result is made from.
        way_out: What to change.

    Raises:
        BadInput: If the folder isn't there or takes no files, this is a folder, or one of the sources; or if it is
            standard output, and that is closed.
    """
    if path is None or is_standard_output(path):
        _refuse_closed()
        return
    target = Path(os.path.realpath(path))
    try:
        if not target.parent.is_dir():
            raise BadInput(f"{path}: there is no such folder; {way_out}")
        if target.is_dir():
            raise BadInput(f"{path}: this is a folder; name a file in it")
        if any(source.exists() and target.exists() and target.samefile(source) for source in sources):
            raise BadInput(f"{path}: this is what is read, and would be lost; choose another name with -o")
        if target.exists() and not target.is_file():
            return  # a pipe or device, which is written through
        _refuse_frozen(target)
        try_out(target.parent)
    except OSError as error:
        raise BadInput(f"{path}: cannot be written ({reason_of(error)}); {way_out}") from None


def check_folder(folder: Path, option: str) -> None:
    """Check that a folder for results can be created and written to.

    Args:
        folder: The folder, which need not exist.
        option: The option that names it.

    Raises:
        BadInput: If nothing can be written to it.
    """
    there = Path(os.path.realpath(folder))
    try:
        while not os.path.lexists(there):
            there = there.parent
        if not there.is_dir():
            raise BadInput(f"{folder}: {'this' if there.name == folder.name else there} is no folder; choose another "
                           f"with {option}")
        try_out(there)
    except OSError as error:
        raise BadInput(f"{folder}: cannot be written to ({reason_of(error)}); choose another with {option}") from None


def write_result(path: Path | None, content: str | bytes) -> None:
    """Write a result to a file, atomically, or to standard output; to pipes and devices directly.

    Raises:
        BadInput: If it can't be written.
    """
    try:
        data = content.encode("utf-8") if isinstance(content, str) else content
    except UnicodeEncodeError as error:
        name = error.object[max(error.start - 40, 0):error.end]
        raise BadInput(f"{name!r}: this name is no UTF-8, and no file of ours can hold it; rename what it is of"
                       ) from None
    if path is None or is_standard_output(path):
        _refuse_closed()
        if isinstance(content, str):
            sys.stdout.write(content)
        else:
            sys.stdout.buffer.write(content)
        return
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_file():
        try:
            target.write_bytes(data)
        except BrokenPipeError:
            return  # the reader has closed the pipe
        except OSError as error:
            raise BadInput(f"{path}: cannot be written ({reason_of(error)}); {ANOTHER_PLACE}") from None
    else:
        write_file(path, data, ANOTHER_PLACE)


def write_beside(path: Path, name: str, content: bytes) -> None:
    """Write a file by its name relative to the folder of another file.

    Raises:
        BadInput: If it can't be written.
    """
    target = path.parent / name
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"{target.parent}: cannot be made ({reason_of(error)}); {ANOTHER_PLACE}") from None
    write_result(target, content)


def _refuse_closed() -> None:
    if output_is_closed():
        raise BadInput(f"{CLOSED}; open it, or name a file with -o")


def _refuse_frozen(target: Path) -> None:
    """Raise the error that replacing an immutable file, or one on a read-only file system, will raise."""
    if not target.exists():
        return
    try:
        os.close(os.open(target, os.O_WRONLY | os.O_NONBLOCK))
    except OSError as error:
        if error.errno in (errno.EPERM, errno.EROFS):  # not EACCES: a file without write bits is replaced, as by mv
            raise
