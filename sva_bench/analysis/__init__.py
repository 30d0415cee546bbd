"""Statistics of outcomes."""
