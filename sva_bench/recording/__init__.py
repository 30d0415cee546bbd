"""Recordings: a view of traces, never the truth of a run."""
