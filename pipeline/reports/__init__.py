"""Write pages that open offline, one room a page, and the kit they share."""
