"""Solids, grids and distances in the plane: arrays only."""
