"""The posterior of all ranges and of everything unknown in a scene, as a resumable fold."""
