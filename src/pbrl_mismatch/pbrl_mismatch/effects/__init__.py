"""The library of effects: what may have been left out of a model, one file an effect."""
