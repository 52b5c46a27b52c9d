"""Error bars of stability limits: sensitivities, drawn samples, and the interval that holds the true limit."""
