"""Draws as files: one file a form, each with its `Export`, entered in the registry."""
