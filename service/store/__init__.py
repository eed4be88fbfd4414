"""The durable store of jobs: what it keeps, where, and how its tables come to be."""
