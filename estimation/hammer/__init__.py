"""Hammer tests: taps found and judged, windowed, averaged, and merged to one FRF matrix by points hit and measured."""
