"""Pictures a researcher would publish: each returns a matplotlib figure and touches no file."""
