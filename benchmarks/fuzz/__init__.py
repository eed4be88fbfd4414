"""The service under bodies that nobody meant."""
