"""Studies as a user runs them: configuration, search, report and the command line."""
