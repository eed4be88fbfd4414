"""From a density to draws: starting points, populations, maps, ensembles, and their verdict."""
