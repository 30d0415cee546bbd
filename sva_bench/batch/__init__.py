"""Batches: Monte Carlo over many worlds that loses nothing of what is done."""
