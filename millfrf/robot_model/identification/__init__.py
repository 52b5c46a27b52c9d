"""Parameters of a robot from measured FRFs, frequencies or deflections, with standard errors."""
