"""Simulate one shift: geometry, contact, plant, engagement, and what is read of its run."""
