"""Estimators over many frames: everything unknown fitted at once, ranges eliminated."""
