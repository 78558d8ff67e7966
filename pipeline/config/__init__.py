"""Read a study file and build the problem from it."""
