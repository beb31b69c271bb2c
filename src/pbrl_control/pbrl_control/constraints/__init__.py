"""What the physics of an object lets a robot do with it, and what that takes (thesis 6.3.2, figure 40)."""
