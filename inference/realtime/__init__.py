"""One file a technique: readings of a frame to all physical ranges."""
