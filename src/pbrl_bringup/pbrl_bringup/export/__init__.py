"""A learned object in the words of other stacks: URDF, SDF, JSON with its schema, ArviZ netCDF."""
