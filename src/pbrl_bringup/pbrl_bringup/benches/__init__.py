"""Benches: each measures one group of acceptance rows. One module a bench, imported when it is run."""
