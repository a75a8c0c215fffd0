"""`python -m motes` is the command `motes`."""

from motes.cli import main

main()
