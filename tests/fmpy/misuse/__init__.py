"""Misuse of the C interface, each case in its own process, so that a crash or a hang is a result."""
