"""Candidate causes ranked without a fit, and the fits of the best of them."""
