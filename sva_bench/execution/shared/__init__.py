"""Robots that share one world: the order in which they pass where only one can be."""
