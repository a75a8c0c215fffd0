"""Laws between particles."""
