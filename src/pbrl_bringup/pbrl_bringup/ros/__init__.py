"""What talks to running nodes; the only place of this package that imports rclpy."""
