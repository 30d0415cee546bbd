"""Measurements of sva-bench itself; each file says how it is run."""
