"""Compare designs, studies and contact sets side by side."""
