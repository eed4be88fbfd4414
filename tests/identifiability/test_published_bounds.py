"""Rank, least singular value and Cramer-Rao bounds against published tables, digit by digit."""

import pytest

from tests.identifiability.published import (
    BARE,
    CROSSTALK,
    OBJECT,
    SHADOW,
    System,
    is_printed,
    range_bounds,
)

# R unknown. Case A: the shadow is the object's; B: it has parameters of its own. Columns: case, R,
# frames, of which gone, rank, least singular value, and at a signal-to-noise ratio of one the
# bounds of log R and of log r (median, worst), as printed.
PROPORTIONAL = """
A  3 7 0 5 0.0051 69 87 1300 | A  3 10 0 5 0.0063 60 100 1100 | A  3 40 0 5 0.014 28 37 520
A  3 7 1 5 0.013 1.2 12 20 | A  3 10 3 5 0.02 0.75 7.8 17 | A  3 40 3 5 0.044 0.6 3.4 16
B  3 7 0 7 3.4e-7 850 190000 210000 | B  3 10 0 7 5.4e-6 150 11000 12000
B  3 40 0 7 8.4e-5 30 650 730 | B  3 7 1 7 2.0e-6 1.4 35000 37000
B  3 10 3 7 2.8e-6 0.8 24000 26000 | B  3 40 3 7 0.00021 0.72 300 320
A 10 7 0 5 0.0057 77 6.1 69 | A 10 10 0 5 0.0094 54 4.8 48 | A 10 40 0 5 0.019 27 2.2 24
A 10 7 1 5 0.018 1.2 2.8 4.2 | A 10 10 3 5 0.025 0.76 2.4 3.2 | A 10 40 3 5 0.053 0.65 1.3 1.6
B 10 7 0 7 5.4e-7 1400 44000 45000 | B 10 10 0 7 5.7e-6 380 4000 4100
B 10 40 0 7 5.2e-5 110 400 420 | B 10 7 1 7 3.2e-6 1.4 8000 8000
B 10 10 3 7 8.2e-6 0.82 3100 3100 | B 10 40 3 7 0.00014 0.79 170 170
"""
ADDITIVE = """
A  3 7 0 5 0.00064 540 690 9900 | A  3 10 0 5 0.00092 430 730 7800
A  3 40 0 5 0.0043 110 130 2000 | A  3 7 1 5 0.0017 6.8 69 89
A  3 10 3 5 0.0029 4.2 34 51 | A  3 40 3 5 0.016 2.1 7.4 25
B  3 7 0 7 4.4e-8 6600 1.5e6 1.6e6 | B  3 10 0 7 7.8e-7 1100 79000 86000
B  3 40 0 7 2.7e-5 150 1800 2100 | B  3 7 1 7 2.5e-7 8.5 280000 290000
B  3 10 3 7 3.8e-7 4.7 180000 190000 | B  3 40 3 7 6.9e-5 3.6 870 930
A 10 7 0 5 0.00063 790 48 710 | A 10 10 0 5 0.0015 410 34 370 | A 10 40 0 5 0.0049 130 8.2 120
A 10 7 1 5 0.0019 14 15 29 | A 10 10 3 5 0.0033 8.1 8.6 16 | A 10 40 3 5 0.026 4.5 2.2 7.5
B 10 7 0 7 4.7e-8 17000 500000 520000 | B 10 10 0 7 7.2e-7 3600 31000 32000
B 10 40 0 7 2.5e-5 540 720 790 | B 10 7 1 7 2.7e-7 17 94000 94000
B 10 10 3 7 8.1e-7 9.2 31000 31000 | B 10 40 3 7 6.3e-5 6.5 350 350
"""


def rows(table: str) -> list[list[str]]:
    return [row.split() for line in table.strip().splitlines() for row in line.split("|")]


@pytest.mark.parametrize(
    ("noise", "row"),
    [
        (noise, row)
        for noise, table in (("P", PROPORTIONAL), ("A", ADDITIVE))
        for row in rows(table)
    ],
    ids=lambda part: part if isinstance(part, str) else "-".join(part[:4]),
)
def test_unknown_distance(noise: str, row: list[str]) -> None:
    case, distance, frames, gone, rank, least, of_r, median, worst = row
    shared = case == "A"
    unknown = (*OBJECT, *BARE, *(() if shared else SHADOW))
    system = System(
        unknown, float(distance), noise, frames=int(frames), gone=int(gone), shared=shared
    )
    found = system.information()
    assert found.rank == int(rank) == len(unknown)
    assert found.margin > 1e6
    assert is_printed(found.singular_values[-1], float(least))
    assert is_printed(found.sd[found.names.index(BARE[1])], float(of_r))
    _, middle, largest = range_bounds(found)
    assert is_printed(middle, float(median))
    assert is_printed(largest, float(worst))


# the other systems, at 40 frames: unknown, R, noise, gone, shadow shared, published bounds of
# parameters, of log r (best, median, worst)
Triple = tuple[float, float, float]
D = (*CROSSTALK, "object.c2")
E = (*CROSSTALK, *OBJECT)
F1 = (*E, *BARE)
G = (*OBJECT, *SHADOW)
OTHERS: list[tuple[tuple[str, ...], float | None, str, int, bool, dict[str, float], Triple]] = [
    (D, None, "P", 0, False, {"object.c2": 1.7}, (0.49, 1.2, 11)),
    (D, None, "A", 0, False, {"object.c2": 1.8}, (0.39, 6.5, 67)),
    (E, None, "P", 0, False, {"object.c0": 9.6, "object.c2": 28, "object.c1": 40}, (0.75, 2.1, 18)),
    (E, None, "A", 0, False, {"object.c0": 21, "object.c2": 48, "object.c1": 83}, (0.87, 7.4, 120)),
    (D, 3.0, "P", 0, False, {}, (0.55, 5.2, 66)),
    (D, 10.0, "P", 0, False, {}, (0.50, 1.9, 20)),
    (D, 10.0, "A", 0, False, {}, (0.41, 8.5, 89)),
    ((*CROSSTALK, *BARE), 3.0, "P", 0, False, {BARE[1]: 440}, (1.2, 42, 360)),
    ((*CROSSTALK, *BARE), 10.0, "P", 0, False, {BARE[1]: 3100}, (0.79, 19, 120)),
    ((*CROSSTALK, *BARE), 10.0, "A", 0, False, {BARE[1]: 7200}, (1.5, 54, 380)),
    (F1, 3.0, "P", 0, True, {BARE[1]: 1200}, (31, 97, 1100)),
    (F1, 10.0, "P", 0, True, {BARE[1]: 59000}, (35, 210, 1700)),
    (F1, 10.0, "A", 0, True, {BARE[1]: 190000}, (90, 850, 5900)),
    (F1, 3.0, "P", 3, True, {}, (11, 33, 300)),
    (F1, 10.0, "P", 3, True, {}, (8.5, 15, 19)),
    (F1, 10.0, "A", 3, True, {}, (28, 49, 110)),
    ((*F1, *SHADOW), 3.0, "P", 0, False, {BARE[1]: 2e5}, (3600, 14000, 74000)),
    ((*F1, *SHADOW), 10.0, "P", 0, False, {BARE[1]: 8e5}, (2600, 5000, 12000)),
    ((*F1, *SHADOW), 10.0, "A", 0, False, {}, (5900, 15000, 52000)),
    (BARE, 3.0, "P", 0, False, {BARE[1]: 2.6}, (0.28, 3.5, 43)),
    (BARE, 10.0, "P", 0, False, {BARE[1]: 9.7}, (0.24, 0.92, 8.9)),
    (BARE, 10.0, "A", 0, False, {BARE[1]: 55}, (0.0073, 4.8, 50)),
    (("object.c2", *BARE), 3.0, "P", 0, False, {BARE[1]: 3.1}, (0.50, 3.9, 50)),
    (("object.c2", *BARE), 10.0, "P", 0, False, {BARE[1]: 11}, (0.41, 0.93, 10)),
    (OBJECT, 3.0, "P", 0, True, {}, (1.2, 2.7, 14)),
    (OBJECT, 10.0, "P", 0, True, {}, (0.82, 1.2, 1.5)),
    (OBJECT, 10.0, "A", 0, True, {}, (0.55, 1.7, 6.4)),
    (G, 3.0, "P", 0, False, {"object.c0": 1100, SHADOW[1]: 3700}, (160, 250, 270)),
    (G, 10.0, "P", 0, False, {"object.c0": 550, SHADOW[1]: 6300}, (83, 160, 160)),
    (G, 10.0, "A", 0, False, {}, (150, 270, 280)),
]


@pytest.mark.parametrize("case", OTHERS, ids=lambda c: f"{len(c[0])}-{c[1]}-{c[2]}-{c[3]}")
def test_other_unknowns(
    case: tuple[tuple[str, ...], float | None, str, int, bool, dict[str, float], Triple],
) -> None:
    unknown, distance, noise, gone, shared, published, ranges = case
    crosstalk = CROSSTALK[0] in unknown
    system = System(unknown, distance, noise, crosstalk, gone=gone, shared=shared)
    found = system.information()
    assert found.rank == len(unknown)
    for name, printed in published.items():
        assert is_printed(found.sd[found.names.index(name)], printed), name
    for value, printed in zip(range_bounds(found), ranges, strict=True):
        assert is_printed(value, printed)


def test_least_singular_value_of_known_distance_and_free_shadow() -> None:
    assert is_printed(System(G, 3.0).information().singular_values[-1], 2.6e-4)
    assert is_printed(System(G, 10.0).information().singular_values[-1], 1.6e-4)
