"""What a user should know before trusting a chain."""
