"""What a user runs: configuration, search, report and the command line."""
