"""Navigation among movable obstacles whose physics is not known (thesis 6.2, 6.4, 6.5)."""
