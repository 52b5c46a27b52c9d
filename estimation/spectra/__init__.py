"""Averaged spectra of recordings: windows, stacking, coherence, independence of inputs, and usable samples."""
