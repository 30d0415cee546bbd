"""Run folders and tables on disk."""
