"""Branch and cut on the edge model, with a search tree of its own: HiGHS solves the linear programs alone."""
