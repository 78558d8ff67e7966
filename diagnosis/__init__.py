"""Bench data and how far the simulation is from them."""
