"""Batches: Monte Carlo over many worlds, with results kept unit by unit."""
