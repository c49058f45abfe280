"""Models of mechanisms: made, run, answered."""
