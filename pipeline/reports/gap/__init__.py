"""Write the report of a diagnosis."""
