"""What a multi-robot mission plan is worth when robots fail, measured in physics."""

from importlib.metadata import version

__version__ = version("sva-bench")
