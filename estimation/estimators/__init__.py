"""Estimators of the FRF: least squares, errors in variables, local polynomials."""
