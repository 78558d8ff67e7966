"""Check a design by closed forms: strength, locking, landing, manufacture, tolerances."""
