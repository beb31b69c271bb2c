"""Learning from states before and after actions, as the regressions do (thesis section 5.3)."""
