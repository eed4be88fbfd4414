"""What a posterior is computed with and nothing else needs, imported with the first one.

It takes a second of processor time, for which only a process waits that computes a posterior.
"""

import functools

from simulator.processor_time import uncounted

__all__ = ["import_libraries"]


@functools.cache
def import_libraries() -> None:
    """Import emcee and, with it, scipy's statistics; that counts for no limit of time."""
    with uncounted():
        import emcee  # noqa: F401
