"""Golem Krang in Bullet, with furniture on casters; sim_node."""
