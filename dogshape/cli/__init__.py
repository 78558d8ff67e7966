"""Command line: verbs, options, tables. Adapters that compute nothing."""
