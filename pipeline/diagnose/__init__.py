"""Diagnose a bench data set: its bank first, then inference and consequence."""
