"""Recordings: the MCAP contract, bags in and out, episodes; recorder and player nodes."""
