"""Write parts and drawings: STEP, STL, SVG."""
