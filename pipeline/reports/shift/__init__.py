"""Write the page of one shift: animation, curves, and its story in words."""
