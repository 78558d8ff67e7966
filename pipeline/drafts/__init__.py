"""Commented folders to begin with: a study of one's own, a bench of one's own."""
