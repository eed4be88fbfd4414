"""Coverage outside the posterior's own model: surfaces by exact optics, and recorded photons.

How often do the 90 % intervals of the ranges hold the truth where the object parameter model, that
the posterior believes in, is only nearly right? Within one data set all ranges share the unknowns
and miss together, so that a data set counts as one observation.
"""
