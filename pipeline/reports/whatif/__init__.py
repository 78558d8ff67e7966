"""The page that answers "what if" while one moves a number, without a network."""
