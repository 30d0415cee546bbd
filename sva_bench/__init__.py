"""What a multi-robot mission plan is worth when robots fail, measured in physics."""

import sys

from sva_bench.safe_path import distrust_current_folder

if sys.argv[:1] == ["-m"]:  # as a program, before anything else is imported
    distrust_current_folder()

__version__: str


def __getattr__(name: str) -> object:
    """``__version__``, found out when it is asked for: that takes longer than Ctrl-C should have to wait."""
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib.metadata import version

    return version("sva-bench")
