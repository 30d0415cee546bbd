"""Stages put together: from a world to its summary."""
