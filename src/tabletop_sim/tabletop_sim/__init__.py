"""A table with items, an arm that pushes them with a ball, and a camera over it, in Bullet (thesis chapter 3)."""
