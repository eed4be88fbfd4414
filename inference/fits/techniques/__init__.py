"""The techniques of many frames, one file each, and their registry."""
