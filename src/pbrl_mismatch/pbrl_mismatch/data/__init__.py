"""What was recorded, laid out for the kernels: tracks, windows, residual wrenches."""
