"""The report of a diagnosis of the sim-to-real gap: words, figures and tables in one HTML file."""
