"""A compiled engine: the same faces, pressure and friction as the Drake plant, in closed form."""
