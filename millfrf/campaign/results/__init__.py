"""Results of a campaign: the table of modes, drift and outliers, maps over postures, and the report."""
