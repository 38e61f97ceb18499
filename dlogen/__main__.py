"""`python -m dlogen`."""

from dlogen.cli import main

main()
