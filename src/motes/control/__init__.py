"""Numbers that vary: constants, random draws, curves over time, life or speed, colour gradients."""
