"""Poles over model order by a right matrix fraction, and the stabilisation chart that chooses among them."""
