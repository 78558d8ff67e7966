"""Store results on disk: folders, journals, locks, trials, claims, records."""
