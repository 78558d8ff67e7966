"""Proof of the diagnosis on data whose effect is withheld: truth, sealed cases and their score."""
