"""Tests of the real-time techniques."""
