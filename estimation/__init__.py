"""Spectra, coherence and frequency response functions from recordings: knows nothing of modes."""

from estimation.cross_spectra import CrossSpectra, SpectralSettings
from estimation.frf import Frf, FrfCovariance

__all__ = ["CrossSpectra", "Frf", "FrfCovariance", "SpectralSettings"]
