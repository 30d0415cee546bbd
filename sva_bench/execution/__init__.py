"""Plans driven in physics, and what comes of them trial by trial."""
