"""Linear least squares on ranges of single frames."""
