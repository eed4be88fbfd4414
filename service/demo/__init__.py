"""``hybridtof demo``: from readings to distances through the running service."""
