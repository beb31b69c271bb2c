"""Where a model and a recording part, whatever the reason: in time, in which frame, at what speed, where it acts."""
