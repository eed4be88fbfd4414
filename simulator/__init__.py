"""What light does, and what a sensor reads."""
