"""Report pages of the diagnoses: structure, robot, and cutting process."""
