"""Models of the user's own equations, and their fit."""
