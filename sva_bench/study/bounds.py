"""What numbers a run can be told, from the command line or from Python."""

from __future__ import annotations

MOST_SEED = 2**63 - 1
MOST_TRIALS = 10_000_000
MOST_ROLLOUTS = 100_000
MOST_DRAWS = 10_000  # of a check under noise, which keeps each
