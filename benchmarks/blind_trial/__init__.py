"""A blind trial of the diagnosis: cases with a concealed cause, sealed truths, and their scoring."""
