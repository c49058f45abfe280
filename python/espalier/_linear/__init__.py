"""The direct solver and what is around it."""
