"""The residual of a hypothesis, and whether it is noise."""
