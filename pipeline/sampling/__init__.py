"""Samplers of the search."""
