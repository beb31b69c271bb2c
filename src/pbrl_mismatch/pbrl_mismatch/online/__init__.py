"""Watches what is heard while it happens: does each object's model still foretell it, and if not, why."""
