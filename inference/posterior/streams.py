"""Random streams of a job: one for every purpose, distinct, and the same in whatever process."""

import enum

__all__ = ["Stream"]


class Stream(enum.IntEnum):
    """What random numbers are drawn for.

    A stream is told by the job's seed, its purpose and, where a purpose has several, their
    numbers. Members keep their values: with them a seed gives the same draws.
    """

    SCREEN = 0
    """Points of the prior that the search for optima begins at."""
    SCOUTS = 1
    """A small population from the prior that looks for what the search has missed."""
    IMPORTANCE = 2
    """Importance sampling as the answer."""
    ENSEMBLES = 3
    """Starting points and moves of the ensembles."""
    ANSWER = 4
    """Resampling, ranges and replicated readings of the answer."""
    CROSS_CHECK = 5
    """Importance sampling that the ensembles are held to."""
    WARM = 8
    """Importance draws that ensembles may start from."""
    POPULATIONS = 9
    """Populations, each by its number and that of the temperature."""
    MEMBERS = 10
    """Which members of a population the ensembles start from."""
    MODEL_ERROR = 12
    """Errors of the model that draws are moved by."""
    REPRESENTATIVES = 13
    """Frames that are sampled in the name of all."""
    PARTS = 14
    """Which frames of many are judged together, and the draws of their ranges."""
    ROUNDS = 15
    """Importance draws from maps that are fitted to populations, and to those before; every step of
    such rounds by its number."""
    RESPONSE = 16
    """Draws at which the response to errors of the model is looked at, and what moves them."""
    AT_REST = 17
    """Draws from the prior of what frames of an object at rest hardly tell."""
    CANDIDATES = 1000
    """Assessment of the models with and without optional terms, each by its number."""
