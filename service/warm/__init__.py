"""Machine code ahead of the first question."""
