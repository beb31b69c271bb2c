"""Work in pieces on a Dask cluster: of this machine, or of several."""
