"""The comparison of a modal model with recordings of forces and responses."""
