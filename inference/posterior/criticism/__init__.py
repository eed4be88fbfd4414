"""Whether to believe an answer: the model against the data, the draws against the density."""
