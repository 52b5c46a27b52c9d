"""Modal parameters over the level of excitation, without any assumed law."""
