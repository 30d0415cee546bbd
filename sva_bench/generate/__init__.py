"""Inputs made: terrain, missions, worlds, instances."""
