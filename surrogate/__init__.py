"""The Gaussian process that stands in for the simulation."""
