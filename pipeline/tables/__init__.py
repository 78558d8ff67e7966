"""Tables for people at the command line and records beside them, by what they show."""
