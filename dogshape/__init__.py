"""Simulate, search, check and diagnose dog clutches."""
