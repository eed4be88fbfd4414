"""When an unknown background distance can be told from the readings, and when it cannot.

Forty frames of a plate (0.4 m, diffuse) before a uniform background whose distance R and strength
are unknown, as the plate itself is: with the plate's own shadow (case A) and with a shadow of
unknown shape (case B). The ranges are spread as draws from their prior are, loguniform over the
span, and the posterior is told the reference prior. Case W is case A under a loguniform prior of
the ranges that reaches far beyond the background. Read noise alone, of the same size in both
windows; the signal-to-noise ratio is that of the whole reading at the geometric mean of the
ranges. The table holds one posterior a line, beside the Cramer-Rao bound, in which the ranges are
free, and the spread predicted with all priors, both at the truth.
"""
