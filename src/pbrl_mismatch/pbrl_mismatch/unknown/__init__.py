"""A mismatch that no effect explains, described: sparse regression on physical features and a Gaussian process."""
