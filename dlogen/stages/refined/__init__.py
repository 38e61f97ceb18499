"""The stages of the profile refined: order without a start, and a fit of the tube itself."""
