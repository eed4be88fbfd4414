"""Streams: a multi-hypothesis filter in (log r, rate)."""
