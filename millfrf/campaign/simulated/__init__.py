"""A campaign on a simulated robot cell: recordings with things hidden in them, and their truth."""
