"""The noise of responses and forces, inferred from residual lines."""
