"""Draw relative angles and uncertain quantities, simulate many shifts, and average them."""
