"""Compiled: the motion of one body with every effect of the library in one parameter row."""
