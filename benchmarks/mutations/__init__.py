"""Faults that are planted in a copy of the source, to see whether the tests notice.

    python -m benchmarks.mutations                  all that have no result yet, then the table
    python -m benchmarks.mutations --only NAME...   those, anew
    python -m benchmarks.mutations --named-only     no more than the tests that a fault names
    python -m benchmarks.mutations --table          the table of what is known by now
    python -m benchmarks.mutations --clean          the named tests on the copy as it is

A fault is an entry of `faults.toml`: a text that stands once in a file, and what stands there
instead. It is planted in a copy of the tree, never in the tree itself. The tests that it names run
first and end with the first failure; only where they all pass every fast test of the suite runs.
Each result is a file under `out/mutations`, so that a run that was stopped goes on where it was;
`results.csv` beside this file is the table of the last run.
"""
