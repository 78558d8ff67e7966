"""Compute the stress at the root of a dog by finite elements."""
