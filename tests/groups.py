"""Which tests one process runs: those of a group need the same kernels, or share a fixture."""

__all__ = ["TOGETHER", "group_of"]

TOGETHER = {
    "density": "density",
    "frame": "density",
    "contract": "fits",
    "fits": "fits",
    "identifiability": "fits",
    "realtime": "fits",
    "optics": "optics",
    "tracking": "tracking",
}
"""Folders whose tests compile the same kernels, and the group that they make."""


def group_of(node_id: str) -> str:
    """Return the group of a test: that of its folder, or the file that it stands in.

    Parameters
    ----------
    node_id : str
        As pytest has it, such as ``tests/fits/test_fit.py::test_fit[0]``.
    """
    file = node_id.split("::")[0]
    return TOGETHER.get(file.split("/")[1], file)
