"""From components to machine code: one fused module for each system of a scene."""
