"""`python -m dlogen`."""

from dlogen.cli.main import main

main()
