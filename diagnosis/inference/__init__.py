"""Weigh hypotheses: evidence, predictive check, verdict, next test."""
