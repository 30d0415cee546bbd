"""What a multi-robot mission plan is worth when robots fail, measured in physics."""

import sys

from sva_bench.safe_path import distrust_current_folder

if sys.argv[:1] == ["-m"]:  # as a program, before anything else is imported
    distrust_current_folder()

from importlib.metadata import version

__version__ = version("sva-bench")
