"""Predict bench times under each hypothesis, from a bank of simulated shifts."""
