"""Streams: frames come in as lines, answers go out as lines, and what was answered stays so."""
