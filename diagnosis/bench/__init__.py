"""Read bench data: tables, traces, the stand, and slips of units and axes."""
