"""Curves from files, for `dlogen compare`."""
