"""Bench data: foreign tables, traces, workbooks, the stand, and slips of units and axes."""
