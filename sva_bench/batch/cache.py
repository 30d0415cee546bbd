"""A cache of results by the hash of their inputs, shared by all units, batches and sweeps of a user."""

from __future__ import annotations

import errno
import hashlib
import os
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sva_bench.errors import BadInput
from sva_bench.files.codec import NotOfType, decoded, encoded
from sva_bench.files.digest import code_digest
from sva_bench.workers.engine import Job

_HASH_BYTES = 32
_MAX_BYTES = 1 << 30  # paths between 400 sites stay below
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def default_folder() -> Path:
    """The user's cache folder."""
    root = os.environ.get("XDG_CACHE_HOME")
    return (Path(root) if root else Path.home() / ".cache") / "sva-bench"


@dataclass(frozen=True, kw_only=True)
class Cache:
    """A folder of results; only one process of a batch writes to it.

    Files are data with a checksum (``codec``), never code. A file that is truncated, altered, not exactly of the type
    of its job's result, inconsistent with the job, or not written by this user alone counts as absent. Files are in a
    folder for each version, which only its user may write to.
    """

    folder: Path

    def get(self, job: Job, key: str) -> Any | None:
        """The result of a job, by its key; ``None`` if there is no valid one.

        Raises:
            BadInput: If the cache cannot be read, or others could have written to it.
        """
        try:
            if not self._is_there():
                return None
            content = _read(self._path(job.kind, key))
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as error:
            if error.errno == errno.ELOOP:  # a link, which we never make
                return None
            raise BadInput(f"{self.folder}: the cache cannot be read ({error.strerror}); choose another with --cache"
                           ) from None
        check, body = content[:_HASH_BYTES], content[_HASH_BYTES:]
        if hashlib.sha256(body).digest() != check:
            return None
        try:
            result = decoded(body, job.result)
        except NotOfType:
            return None
        return result if job.fits(result) else None

    def put(self, job: Job, key: str, result: Any) -> None:
        """Store the result of a job under its key, atomically.

        Raises:
            BadInput: If it cannot be written, or others can write to the cache.
        """
        body = encoded(result, job.result)
        path = self._path(job.kind, key)
        draft = path.with_name(f"{path.name}.{os.getpid()}.tmp")
        try:
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            self._home.mkdir(mode=0o700, exist_ok=True)
            self._is_there()
            path.parent.mkdir(parents=True, exist_ok=True)
            draft.unlink(missing_ok=True)  # of a process that was killed
            with os.fdopen(os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
                file.write(hashlib.sha256(body).digest() + body)
            draft.replace(path)
        except OSError as error:
            draft.unlink(missing_ok=True)
            raise BadInput(f"{self.folder}: the cache cannot be written to ({error.strerror}); choose another with "
                           "--cache") from None

    @property
    def _home(self) -> Path:
        """The folder of this version: results depend on the code."""
        return self.folder / code_digest()[:16]

    def _path(self, kind: str, key: str) -> Path:
        return self._home / kind / key[:2] / key

    def _is_there(self) -> bool:
        """Whether this version's folder is there.

        Raises:
            BadInput: If others could have put something into it.
        """
        try:
            found = self._home.lstat()
        except FileNotFoundError:
            return False
        if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.geteuid() or found.st_mode & _OTHERS_WRITE:
            raise BadInput(f"{self._home}: others can write to this part of the cache (owner {found.st_uid}, mode "
                           f"{stat.S_IMODE(found.st_mode):o}); remove it, or choose another cache with --cache")
        return True


def _read(path: Path) -> bytes:
    """The content of a file that only this user can have written; empty for any other."""
    handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    with os.fdopen(handle, "rb") as file:
        found = os.fstat(handle)
        ours = stat.S_ISREG(found.st_mode) and found.st_uid == os.geteuid() and not found.st_mode & _OTHERS_WRITE
        return file.read() if ours and found.st_size <= _MAX_BYTES else b""
