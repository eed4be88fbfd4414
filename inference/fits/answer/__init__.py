"""From optima of the likelihood to a result, or to a refusal with its reason and remedy."""
