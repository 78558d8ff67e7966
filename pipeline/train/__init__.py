"""Simulate what the surrogate learns from, fit it, and find fitted ones."""
