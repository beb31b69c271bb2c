"""Agents that learn a world model and act by planning in it (thesis section 5.5.1)."""
