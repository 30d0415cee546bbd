"""No code of the current folder is run: a ``numba.py`` that lies beside somebody's worlds is no library of ours.

Python looks for modules in the current folder where it is started with ``-m`` or ``-c``, as worker processes are, and
where PYTHONPATH holds an empty entry, as ``PYTHONPATH=$PYTHONPATH:/opt/lib`` leaves one.
This file is imported before all others, so it imports nothing but what is part of the interpreter itself.
"""

import os
import sys

_SAFELY = {
    "PYTHONSAFEPATH": "1",  # interpreters that are started from here don't look into the current folder either
    "NUMBA_CACHE_DIR": "",  # its default; else a .numba_config.yaml in the current folder says where to load code from
}


def distrust_current_folder() -> None:
    """Take the current folder out of where this process and its children find modules, unless PYTHONPATH names it."""
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
    """The environment for an interpreter that is to find what this one finds, and nothing in the current folder."""
    found = [entry for entry in sys.path if entry and os.pathsep not in entry]
    return {**_SAFELY, **os.environ, "PYTHONSAFEPATH": "1", "PYTHONPATH": os.pathsep.join(found)}
