"""Modal models of FRF matrices by variable projection: selection, refinement and error bars."""
