"""Build the ring as a closed solid, for printing and drawing."""
