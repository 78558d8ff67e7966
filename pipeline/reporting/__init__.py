"""The report of a study: words, tables, figures and pages of its shifts, in one HTML file."""
