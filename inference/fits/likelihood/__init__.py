"""The likelihood of all frames, every range at its best value, and its optima."""
