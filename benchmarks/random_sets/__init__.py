"""Random sets that nobody tuned to: what every way to a range says of them, and how far it is off.

Nothing is stated of ranges or errors of the model, so that what is held to the truth is what stands
by default.
"""
