"""Error bars of stability limits: sensitivities, drawn samples, confidence intervals."""
