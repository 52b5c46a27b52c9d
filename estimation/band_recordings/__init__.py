"""Recordings reduced to a band: matched channels, one resampling, one set of motion quantities, windowed spectra."""
