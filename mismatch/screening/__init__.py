"""Causes ranked without a fit, and the fits of those that promise most."""
