"""The page of a diagnosis: figures of the residual wrench, the odds, and what the repair gains."""
