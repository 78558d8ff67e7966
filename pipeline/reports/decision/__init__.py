"""Write what a workshop needs of the design that was chosen."""
