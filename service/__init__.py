"""From knowledge to clients: HTTP, streams, command line."""
