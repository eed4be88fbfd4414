"""The curves that real-time techniques invert, a file each.

Every technique but background intensity reduces a frame to one number t (two for a ratio that may
be infinite, or an angle modulo pi) that the curve takes at the right range; the curve depends on
the scene alone. Lengths are in a unit near sqrt(c0), so that nothing overflows.

========================  ==========================================================  ============
curve                     value at u                                                  equation
========================  ==========================================================  ============
intensity                 c0 / (u^2 Q)                                                4.1
intensity_w1              c0 / (u Q)                                                  4.4
differential_ratio        u (3u^2 + 2 c1 u + c0) / (4u^2 + 3 c1 u + 2 c0)             4.68
differential_phase        k u - atan2(k u Q, 4u^2 + 3 c1 u + 2 c0), modulo pi         exact
cancelling_ratio          (1 - u/R) c0 / (u^2 Q)                                      4.73
cancelling_quadrature     sin(k (R - u)) c0 / (u^2 Q)                                 exact
both_ratio                d(u Phi + R Phi_bg) / d(Phi + Phi_bg)                       4.83
both_phase                arg d(Phi e^jku + Phi_bg e^jkR), modulo pi                  exact
========================  ==========================================================  ============

A file holds the curve's kernels and, as a `Curve`, what is known of its shape:

* ``value(u, p)``, and ``slope(u, p)``, its derivative;
* ``guess(top, bottom, p)``: about where the value is top / bottom, from the limits of near and far;
* ``residual(u, top, bottom, p)``: a number with the sign of value - top / bottom, up to a constant
  factor, smooth where the value has a pole;
* ``power_law(u, p)`` of curves that are near power laws at both ends, where Newton's method in
  logarithms is tried: (value, d log value / d log u);
* ``direction(u, p)`` of ratios and angles of derivatives: (denominator, numerator) up to a positive
  factor; and ``turning(u, p)`` of those whose turning points are searched for: a number with the
  sign of the slope, without poles.

`dispatch` calls them by the curve's number, and `registry` lists the curves.
"""
