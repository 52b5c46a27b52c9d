"""Maximum-likelihood modal parameters from whole records, with noise on forces and responses."""
