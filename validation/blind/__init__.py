"""Diagnose cases whose effect is withheld, made by a second engine, and score them."""
