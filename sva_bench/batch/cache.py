"""Results kept by the hash of what they depend on, shared by all units, batches and sweeps of a user."""

from __future__ import annotations

import hashlib
import os
import pickle
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sva_bench.batch.digest import code_digest
from sva_bench.errors import BadInput

_HASH_BYTES = 32


def default_folder() -> Path:
    """The user's cache folder."""
    root = os.environ.get("XDG_CACHE_HOME")
    return (Path(root) if root else Path.home() / ".cache") / "sva-bench"


@dataclass(frozen=True, kw_only=True)
class Cache:
    """A folder of results; only one process of a batch writes to it.

    Files are Python's own serialisation behind a checksum: a torn or altered file counts as absent. As any cache of
    this kind it must be a folder that only its user can write to.
    """

    folder: Path

    def get(self, kind: str, key: str) -> Any | None:
        """What is kept under a key; ``None`` if nothing is, or nothing whole."""
        try:
            content = self._path(kind, key).read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            raise BadInput(f"{self.folder}: the cache cannot be read ({error.strerror}); choose another with --cache"
                           ) from None
        check, body = content[:_HASH_BYTES], content[_HASH_BYTES:]
        return pickle.loads(body) if hashlib.sha256(body).digest() == check else None

    def put(self, kind: str, key: str, value: Any) -> None:
        """Keep a value, whole or not at all.

        Raises:
            BadInput: If it cannot be written.
        """
        body = pickle.dumps(value, protocol=5)
        path = self._path(kind, key)
        draft = path.with_name(f"{path.name}.{os.getpid()}.tmp")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            draft.write_bytes(hashlib.sha256(body).digest() + body)
            draft.replace(path)
        except OSError as error:
            draft.unlink(missing_ok=True)
            raise BadInput(f"{self.folder}: the cache cannot be written to ({error.strerror}); choose another with "
                           "--cache") from None

    def _path(self, kind: str, key: str) -> Path:
        return self.folder / code_digest()[:16] / kind / key[:2] / key
