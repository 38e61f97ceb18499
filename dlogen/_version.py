"""The version, in a file that costs nothing to import (the command line and the build both read it)."""

__version__ = "0.1.0"
