"""`Frf`, the matrix of frequency response functions: its quantity, its known band and its files."""
