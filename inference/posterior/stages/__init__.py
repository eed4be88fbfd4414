"""Where a posterior may stand, one type a stage, and what each stage does next."""
