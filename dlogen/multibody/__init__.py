"""The chain as bodies and joints with masses, springs and limits."""
