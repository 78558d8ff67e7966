"""Run blocks of shifts on all cores and turn them into expectations."""
