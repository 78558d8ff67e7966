"""What the surrogate says of a study: effects, indices and slices, as numbers and as a page."""
