"""From readings to knowledge: estimates, posteriors, ambiguity."""
