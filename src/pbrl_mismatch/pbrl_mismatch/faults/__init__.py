"""What is wrong with a recording itself: found before it is diagnosed, so that no fault is taken for physics."""
