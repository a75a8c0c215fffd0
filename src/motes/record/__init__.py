"""What is measured and kept of a simulation."""
