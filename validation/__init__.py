"""Prove the product: blind check, second engine, finite elements."""
