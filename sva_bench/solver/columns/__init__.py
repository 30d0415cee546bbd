"""Routes as columns: branch and price."""
