"""Files and folders that appear whole or not at all, whatever is killed, and whenever.

What is written is a draft beside its place, brought to the disk and renamed. Its writer holds a lock of the kernel on
it, which ends with the process: a draft that nobody holds was left behind, and the next writer removes it.
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

_LEFT = re.compile(r"\.(?P<name>.+)\.(?P<pid>\d+)(?:-\d+)?\.(?P<kind>tmp|old)", re.DOTALL)
_LONGEST = 200  # of a name's bytes in a draft's name, which is at most 255 long

_TRIAL = "sva-bench-trial"
_TRIAL_BYTES = 1 << 16  # of a disk with less room nothing is to be expected

_AT_FDCWD, _RENAME_EXCHANGE = -100, 2
_UNKNOWN_TO_THE_FILE_SYSTEM = (errno.ENOSYS, errno.EINVAL, errno.EOPNOTSUPP)


def why(error: OSError) -> str:
    """What the system says, in a few words; libraries raise errors that have no number."""
    return error.strerror or (str(error).splitlines() or [type(error).__name__])[0][:120]


@contextmanager
def draft_file(path: Path, way_out: str = "choose another place") -> Iterator[Path]:
    """A file to be written that takes the place of another only when it is whole, and on the disk.

    Args:
        path: Where it belongs; of a link, the file that it leads to is replaced.
        way_out: What to change if it can't be written.

    Raises:
        BadInput: If it can't be written; an older file stays as it was.
    """
    target = Path(os.path.realpath(path))
    begun: _Draft | None = None
    try:
        with holding_back_ctrl_c():  # or a draft is left that nobody knows
            remove_left_behind(target.parent, lambda name: name == _short(target.name))
            begun = _Draft(target, folder=False)
        yield begun.path
        hear_ctrl_c()  # a library that writes may have swallowed it, and left something out
        _to_disk(begun.path)
        os.replace(begun.path, target)
        _to_disk(target.parent)
    except OSError as error:
        raise BadInput(f"{path}: cannot be written ({why(error)}); {way_out}") from None
    finally:
        if begun is not None:
            begun.close()


@contextmanager
def draft_folder(target: Path, way_out: str = "choose another place") -> Iterator[Path]:
    """A folder to be filled that takes the place of another, in one step, only when it is complete.

    Raises:
        BadInput: If it can't be written; an older folder stays as it was.
    """
    begun: _Draft | None = None
    try:
        with holding_back_ctrl_c():
            target.parent.mkdir(parents=True, exist_ok=True)
            begun = _Draft(target, folder=True)
        yield begun.path
        hear_ctrl_c()
        for folder, _, names in os.walk(begun.path, topdown=False):
            for name in names:
                _to_disk(Path(folder, name))
            _to_disk(Path(folder))
        with holding_back_ctrl_c():
            _take_the_place_of(begun.path, target)
        _to_disk(target.parent)
    except OSError as error:
        raise BadInput(f"{target.parent}: cannot be written to ({why(error)}); {way_out}") from None
    finally:
        if begun is not None:
            begun.close()


def write_file(path: Path, content: bytes, way_out: str = "choose another place") -> None:
    """Write a file, whole or not at all.

    Raises:
        BadInput: If it can't be written; an older file stays as it was.
    """
    with draft_file(path, way_out) as draft:
        draft.write_bytes(content)


@contextmanager
def by_way_of(draft: Path, path: Path) -> Iterator[None]:
    """A draft of a given name, written in this block, becomes a file: for folders with one writer at a time.

    Raises:
        OSError: If it can't be written; the draft is gone, and an older file stays as it was.
    """
    try:
        yield
        _to_disk(draft)
        os.replace(draft, path)
    finally:
        with holding_back_ctrl_c(), suppress(OSError):
            draft.unlink(missing_ok=True)


def try_out(folder: Path) -> None:
    """Write something into a folder and take it away again: permissions and free space tell less than the attempt.

    Raises:
        OSError: If it can't be done.
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
    """Remove the drafts that killed processes left in a folder, and put back what they had moved away.

    Args:
        folder: Where to look; nothing is done if it can't be read.
        of: Whether a file or folder of this name is ours to look after.
    """
    try:
        entries = [entry.name for entry in os.scandir(folder)]
    except OSError:
        return
    for entry in entries:
        found = _LEFT.fullmatch(entry)
        if found is None or not of(found["name"]) or _at_work(folder / entry, int(found["pid"][:12])):
            continue
        place = folder / found["name"]
        with suppress(OSError):  # somebody else's then; what stands there is in nobody's way
            if found["kind"] == "old" and not os.path.lexists(place):
                os.rename(folder / entry, place)
            else:
                _remove(folder / entry)


class _Draft:
    """A draft that this process is at work on, and holds locked."""

    def __init__(self, target: Path, *, folder: bool) -> None:
        for number in range(1000):  # another process may have our id, in another container
            again = f"-{number}" if number else ""
            self.path = target.with_name(f".{_short(target.name)}.{os.getpid()}{again}.tmp")
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
        """Remove what is left of it: all, or the older folder whose place it took."""
        with holding_back_ctrl_c(), suppress(OSError):
            _remove(self.path)
        os.close(self._handle)


def _short(name: str) -> str:
    """A name that a draft's can be made of."""
    raw = os.fsencode(name)
    return name if len(raw) <= _LONGEST else sha256(raw).hexdigest()


def _at_work(draft: Path, pid: int) -> bool:
    """Whether the writer of a draft lives. Both are asked: ids are used again, and some file systems know no locks."""
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
        return False  # a link that we never make, or gone
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


def _take_the_place_of(draft: Path, target: Path) -> None:
    """Let the draft have the target's name. What stood there has the draft's name then, if there was anything."""
    if not os.path.lexists(target):
        os.rename(draft, target)
        return
    try:
        _exchange(draft, target)
    except OSError as error:
        if error.errno not in _UNKNOWN_TO_THE_FILE_SYSTEM:
            raise
        # In two steps. Killed between them, the next start puts the older one back.
        old = draft.with_suffix(".old")
        os.rename(target, old)
        os.rename(draft, target)
        os.rename(old, draft)


def _exchange(one: Path, other: Path) -> None:
    """Exchange two names in one step of the kernel (Linux 3.15)."""
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if rename is None:  # a C library of before 2018
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))
    if rename(_AT_FDCWD, os.fsencode(one), _AT_FDCWD, os.fsencode(other), ctypes.c_uint(_RENAME_EXCHANGE)):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number), str(other))


def _to_disk(path: Path) -> None:
    """Bring a file or folder to the disk: else a power cut could leave a renamed file empty."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError:
        if not path.is_dir():  # which some file systems can't
            raise
    finally:
        os.close(handle)
