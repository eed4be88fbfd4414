"""When an unknown background distance can be told from the readings, and when it cannot.

Forty frames of a plate (0.4 m, diffuse) before a uniform background whose distance R and strength
are unknown, as the plate itself is: with the plate's own shadow (case A) and with a shadow of
unknown shape (case B). Read noise alone, of the same size in both windows; the signal-to-noise
ratio is that of the whole reading at the geometric mean of the ranges. The table holds one
posterior a line, beside the Cramer-Rao bound and the spread predicted with the priors, both at the
truth.
"""
