"""Write the page of a surrogate."""
