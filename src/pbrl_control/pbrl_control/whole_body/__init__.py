"""From what grippers are to do to what the whole body does: a program under limits, steering, and the thesis's way."""
