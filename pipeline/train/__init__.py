"""Simulate the data of a surrogate, fit it, and find fitted surrogates."""
