"""The noise of a frame whose light is not known before it is read.

Shot noise is that of the light that is there. Where crosstalk is still to be learnt the prediction
does not know that light: taken at the mean of a prior that is wide, the noise of a bright frame
would be that of a dark one, the frame would weigh far too much, and no later frame takes that back.
So the light is taken where the frame says that it is, as far as crosstalk is open beside the noise.

docs/model.md, learnt-light, has the derivation.
"""

import math

from inference.tracking.readings_table import ReadingsNoise, noise_root
from inference.tracking.roots import Root, add_root, solve
from simulator.compiled import compiled

__all__ = ["noise_at_light"]

# the first finds the light by the noise of the prior's mean, the second weighs it beside its own
_STEPS = 2


@compiled
def _square(root: Root) -> tuple[float, float]:
    """Return the variances of both numbers."""
    return root.r11 * root.r11, root.r21 * root.r21 + root.r22 * root.r22


@compiled
def noise_at_light(
    mean: tuple[float, float],
    signal: tuple[float, float],
    residual: tuple[float, float],
    unknown: Root,
    noise: ReadingsNoise,
) -> Root:
    """Return the root of the noise's covariance at the light that a frame tells.

    Parameters
    ----------
    mean : (float, float)
        Readings that are expected, in units of the read noise.
    signal : (float, float)
        The object's part of them.
    residual : (float, float)
        The readings less these.
    unknown : Root
        Of the covariance that learnt crosstalk gives the readings' light; zero where it is known.
    noise : ReadingsNoise
        How it depends on the light.
    """
    root = noise_root(mean[0], mean[1], signal[0], signal[1], noise)
    open1, open2 = _square(unknown)
    photon = noise.shot
    if (photon == 0.0 and not noise.of_source) or not open1 + open2 > 0.0:
        return root
    for _ in range(_STEPS):
        pull1, pull2 = solve(add_root(root, unknown), residual[0], residual[1])
        part1, part2 = unknown.r11 * pull1 + unknown.r21 * pull2, unknown.r22 * pull2
        light1 = mean[0] + unknown.r11 * part1
        light2 = mean[1] + unknown.r21 * part1 + unknown.r22 * part2
        # given a reading, light of any size as likely is in the mean one photon above it
        own1, own2 = _square(root)
        more1, more2 = open1 / (open1 + own1), open2 / (open2 + own2)
        light1 += math.copysign(photon / noise.ratio * more1, light1)
        light2 += math.copysign(photon * more2, light2)
        root = noise_root(light1, light2, signal[0], signal[1], noise)
    return root
