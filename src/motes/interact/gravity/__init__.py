"""Gravity between particles: direct sums and the fast multipole method."""
