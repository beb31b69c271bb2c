"""What simulates: bodies in lanes, poses at recorded times, Chipmunk where things touch."""
