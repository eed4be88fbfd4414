"""One file a technique of single frames, all of the same template (`inference.technique`)."""
