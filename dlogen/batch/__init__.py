"""Many clouds: finding them, fitting them on many processes or machines, and keeping the records."""
