"""The command line: what can be asked for, and how a command that failed ends."""
