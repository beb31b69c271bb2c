"""The node of this package."""
