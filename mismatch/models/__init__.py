"""Hypotheses about a structure: a modal model with causes, its prediction, its misfit and its fit."""
