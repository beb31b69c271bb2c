"""What the drive with a cart through an office is put together from: percepts, plans, an account of both."""
