"""Atomic writing of files and folders: complete or absent, even if the process is killed.

Content is written to a draft beside the target, synced to disk and renamed. The writer holds a kernel lock on
the draft, which ends with the process: a draft without a lock is stale, and the next writer removes it.
"""

from __future__ import annotations

import ctypes
import errno
import fcntl
import os
import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path

from sva_bench.errors import BadInput
from sva_bench.interrupts import hear_ctrl_c, holding_back_ctrl_c

_DRAFT_NAME = re.compile(r"\.(?P<name>.+)\.(?P<pid>\d+)(?:-\d+)?\.(?P<kind>tmp|old)", re.DOTALL)
_MOST_NAME_BYTES = 200  # of a target's name within the draft's name, which is limited to 255 bytes

_TRIAL = "sva-bench-trial"
_TRIAL_BYTES = 1 << 16  # least free space that is required

_AT_FDCWD, _RENAME_EXCHANGE = -100, 2
_UNKNOWN_TO_THE_FILE_SYSTEM = (errno.ENOSYS, errno.EINVAL, errno.EOPNOTSUPP)


def reason_of(error: OSError) -> str:
    """The system's message of an error, or the first line of a library's error without a number."""
    return error.strerror or (str(error).splitlines() or [type(error).__name__])[0][:120]


@contextmanager
def draft_file(path: Path, way_out: str = "choose another place") -> Iterator[Path]:
    """A draft file that replaces the target atomically when the block ends without an error.

    Args:
        path: The target; of a link, its destination is replaced.
        way_out: What to change if it can't be written, for the message.

    Raises:
        BadInput: If it can't be written; an older file stays as it was.
    """
    target = Path(os.path.realpath(path))
    draft_held: _Draft | None = None
    try:
        with holding_back_ctrl_c():  # else an interrupt could leave a draft without a reference to it
            remove_left_behind(target.parent, lambda name: name == _shortened(target.name))
            draft_held = _Draft(target, folder=False)
        yield draft_held.path
        hear_ctrl_c()  # a library may have swallowed it and written incomplete content
        _sync(draft_held.path)
        os.replace(draft_held.path, target)
        _sync(target.parent)
    except OSError as error:
        raise BadInput(f"{path}: cannot be written ({reason_of(error)}); {way_out}") from None
    finally:
        if draft_held is not None:
            draft_held.close()


@contextmanager
def draft_folder(target: Path, way_out: str = "choose another place") -> Iterator[Path]:
    """A draft folder that replaces the target atomically when the block ends without an error.

    Raises:
        BadInput: If it can't be written; an older folder stays as it was.
    """
    draft_held: _Draft | None = None
    try:
        with holding_back_ctrl_c():
            target.parent.mkdir(parents=True, exist_ok=True)
            draft_held = _Draft(target, folder=True)
        yield draft_held.path
        hear_ctrl_c()
        for folder, _, names in os.walk(draft_held.path, topdown=False):
            for name in names:
                _sync(Path(folder, name))
            _sync(Path(folder))
        with holding_back_ctrl_c():
            _replace(draft_held.path, target)
        _sync(target.parent)
    except OSError as error:
        raise BadInput(f"{target.parent}: cannot be written to ({reason_of(error)}); {way_out}") from None
    finally:
        if draft_held is not None:
            draft_held.close()


def write_file(path: Path, content: bytes, way_out: str = "choose another place") -> None:
    """Write a file atomically.

    Raises:
        BadInput: If it can't be written; an older file stays as it was.
    """
    with draft_file(path, way_out) as draft:
        draft.write_bytes(content)


@contextmanager
def by_way_of(draft: Path, path: Path) -> Iterator[None]:
    """A block that writes a draft of a given name, which then replaces a file; for folders with a single writer.

    Raises:
        OSError: If it can't be written; the draft is removed, and an older file stays as it was.
    """
    try:
        yield
        _sync(draft)
        os.replace(draft, path)
    finally:
        with holding_back_ctrl_c(), suppress(OSError):
            draft.unlink(missing_ok=True)


def try_out(folder: Path) -> None:
    """Test whether files can be written to a folder, by writing and removing one.

    Raises:
        OSError: If they can't.
    """
    remove_left_behind(folder, lambda name: name == _TRIAL)
    with holding_back_ctrl_c():
        trial = _Draft(folder / _TRIAL, folder=False)
        try:
            with trial.path.open("wb") as file:
                file.write(bytes(_TRIAL_BYTES))
                file.flush()
                os.fsync(file.fileno())
        finally:
            trial.close()


def remove_left_behind(folder: Path, of: Callable[[str], bool]) -> None:
    """Remove stale drafts from a folder, and restore folders that a killed process had moved away.

    Args:
        folder: The folder; nothing is done if it can't be read.
        of: Whether a target of this name is to be cleaned up.
    """
    try:
        entries = [entry.name for entry in os.scandir(folder)]
    except OSError:
        return
    for entry in entries:
        found = _DRAFT_NAME.fullmatch(entry)
        if found is None or not of(found["name"]) or _is_held(folder / entry, int(found["pid"][:12])):
            continue
        place = folder / found["name"]
        with suppress(OSError):  # without permission it belongs to another user, and does no harm
            if found["kind"] == "old" and not os.path.lexists(place):
                os.rename(folder / entry, place)
            else:
                _remove(folder / entry)


class _Draft:
    """A draft that this process writes, and holds locked."""

    def __init__(self, target: Path, *, folder: bool) -> None:
        for number in range(1000):  # a process in another container may have the same id
            again = f"-{number}" if number else ""
            self.path = target.with_name(f".{_shortened(target.name)}.{os.getpid()}{again}.tmp")
            try:
                if folder:
                    self.path.mkdir()
                    self._handle = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY)
                else:
                    self._handle = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
            except FileExistsError:
                continue
            with suppress(OSError):  # some network file systems know no locks
                fcntl.flock(self._handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        raise FileExistsError(errno.EEXIST, "a thousand drafts are there already", str(self.path))

    def close(self) -> None:
        """Remove the draft, or the older folder that it was exchanged with, and release the lock."""
        with holding_back_ctrl_c(), suppress(OSError):
            _remove(self.path)
        os.close(self._handle)


def _shortened(name: str) -> str:
    """A target's name, or its hash if it is too long for a draft's name."""
    raw = os.fsencode(name)
    return name if len(raw) <= _MOST_NAME_BYTES else sha256(raw).hexdigest()


def _is_held(draft: Path, pid: int) -> bool:
    """Whether the writer of a draft is alive, by process id and lock: ids are reused, and locks may be unsupported."""
    if pid != os.getpid():
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            pass
        except (OSError, OverflowError):
            return True
        else:
            return True
    try:
        handle = os.open(draft, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError:
        return False  # removed, or a link, which is never a draft
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    finally:
        os.close(handle)
    return False


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _replace(draft: Path, target: Path) -> None:
    """Rename the draft to the target; an existing target gets the draft's name."""
    if not os.path.lexists(target):
        os.rename(draft, target)
        return
    try:
        _exchange(draft, target)
    except OSError as error:
        if error.errno not in _UNKNOWN_TO_THE_FILE_SYSTEM:
            raise
        # In two steps. If killed between them, the next writer restores the older one.
        old = draft.with_suffix(".old")
        os.rename(target, old)
        os.rename(draft, target)
        os.rename(old, draft)


def _exchange(one: Path, other: Path) -> None:
    """Exchange two names atomically (renameat2, Linux 3.15)."""
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if rename is None:  # a C library from before 2018
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))
    if rename(_AT_FDCWD, os.fsencode(one), _AT_FDCWD, os.fsencode(other), ctypes.c_uint(_RENAME_EXCHANGE)):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number), str(other))


def _sync(path: Path) -> None:
    """Sync a file or folder to disk: else a power failure could leave a renamed file empty."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError:
        if not path.is_dir():  # some file systems can't sync folders
            raise
    finally:
        os.close(handle)
