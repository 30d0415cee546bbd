"""Generation of inputs: terrain, missions, worlds, instances."""
