"""One shift: geometry, contact, both engines, result and trace."""
