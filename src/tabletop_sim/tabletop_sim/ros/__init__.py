"""Nodes of tabletop_sim."""
