"""Which optional terms the data demand: evidence and cross-validated predictive density."""
