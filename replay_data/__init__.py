"""The simulated robot cell and its recordings: knows nothing of fitting or diagnosis."""
