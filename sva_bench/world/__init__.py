"""The world: bounds, obstacles, sites, robots, scenarios, and how it is read from a file."""
