"""Hypotheses about a structure: a modal model with causes, its prediction, misfit and fit."""
