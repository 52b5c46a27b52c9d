"""Which modes a band needs: candidates, a trial of each, and modes that the residual still hides."""
