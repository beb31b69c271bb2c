"""Hostile files and messages, made from valid ones, given to everything here that reads any."""
