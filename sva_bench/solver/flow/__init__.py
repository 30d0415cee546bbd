"""The compact models over arcs, and branch and cut on them."""
