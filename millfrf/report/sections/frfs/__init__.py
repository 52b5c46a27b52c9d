"""The FRFs of a report: few as figures, many as pages of small panels, each with the misfit of its model."""

from .choice import Band, axis_of, band_of, shown_frf
from .measured_frfs import frf_section

__all__ = ["Band", "axis_of", "band_of", "frf_section", "shown_frf"]
