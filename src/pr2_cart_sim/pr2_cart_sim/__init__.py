"""The PR2 with a utility cart among people in an office, in Bullet; sim_node."""
