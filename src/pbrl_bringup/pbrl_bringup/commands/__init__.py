"""One module a command, each with `command(...) -> int`; imported when the command is used."""
