"""The regenerative milling loop: tip receptance, delayed state equation, and which teeth cut when."""
