"""`Frf`, the matrix of frequency response functions: quantity, known band, files, reciprocity."""
