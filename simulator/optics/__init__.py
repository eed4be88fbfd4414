"""What light does: a scene of surfaces, a light source and a detector give flux and distance."""
