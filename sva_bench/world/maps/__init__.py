"""Maps that users have already, as occupancy grids: a file for each format."""
