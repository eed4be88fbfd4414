"""Simulation-based calibration: are the posterior's intervals as often right as they say?

Talts et al., arXiv:1804.06788. A truth is drawn from the prior, readings from the truth, and the
posterior of the readings is asked where the truth ranks among its draws. If simulation, density and
sampler agree, every rank is as likely as any other.
"""
