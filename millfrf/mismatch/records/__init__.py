"""Recordings as a model is compared with them: the band, the samples and their spectra."""
