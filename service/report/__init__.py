"""``hybridtof report``: error against run time for every technique and the posterior."""
