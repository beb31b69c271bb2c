"""Whole-body Jacobian control of what the robot holds; body_controller_node and push_node."""
