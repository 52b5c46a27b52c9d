"""Noise, distortion and homogeneity from forces that repeat, and noise where they do not: no model is needed."""
