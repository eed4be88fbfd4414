"""What one frame says: mean readings, noise, derivatives, density along the range."""
