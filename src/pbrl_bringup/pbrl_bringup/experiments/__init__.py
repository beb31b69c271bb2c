"""Experiments of the thesis, repeated; each module has `measure(seed, quick, out)` and writes `figure.png`."""
