"""`ModalModel` and what is computed from it: files, error bars, shape measures, synthesis, comparison."""
