"""What clients get, one file a resource: its shape, for OpenAPI, and how an answer gets it."""
