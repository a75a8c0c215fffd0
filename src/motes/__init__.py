"""motes: a particle-system engine and studio."""
