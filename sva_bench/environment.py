"""What this process and its children take from the environment: no code from the current folder, one thread each.

A ``numba.py`` beside somebody's worlds is not the library: Python looks for modules in the current folder where it is
started with ``-m`` or ``-c``, as worker processes are, and where PYTHONPATH has an empty entry, as
``PYTHONPATH=$PYTHONPATH:/opt/lib`` leaves one.
This file is imported before all others, so it imports only what is part of the interpreter itself.
"""

import os
import sys

_SAFELY = {
    "PYTHONSAFEPATH": "1",  # interpreters started from here don't look for modules in the current folder either
    "NUMBA_CACHE_DIR": "",  # its default; else a .numba_config.yaml in the current folder says where to load code from
}
_ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}


def limit_threads() -> None:
    """Have libraries use one thread, unless the user says otherwise; before numpy is imported.

    The worker processes are the parallelism, and sums keep one order.
    """
    for name, value in _ONE_THREAD.items():
        os.environ.setdefault(name, value)


def distrust_current_folder() -> None:
    """Remove the current folder from the module search path of this process and its children, unless PYTHONPATH has it.
    """
    for name, value in _SAFELY.items():
        os.environ.setdefault(name, value)
    try:
        here = os.getcwd()
    except OSError:  # it was removed
        return
    if sys.argv[:1] == ["-m"] and not sys.flags.safe_path and sys.path[:1] in ([""], [here]):
        del sys.path[0]
    words = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    named = [word for word in words if word]
    if named == words:
        return
    os.environ["PYTHONPATH"] = os.pathsep.join(named)
    ours = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    if here not in (*map(os.path.abspath, named), ours):
        sys.path[:] = [entry for entry in sys.path if entry not in ("", here)]


def environment_of_children() -> dict[str, str]:
    """The environment of worker interpreters: the modules of this process, none of the current folder, one thread."""
    found = [entry for entry in sys.path if entry and os.pathsep not in entry]
    return {**_SAFELY, **os.environ, **_ONE_THREAD, "PYTHONSAFEPATH": "1", "PYTHONPATH": os.pathsep.join(found)}
