"""The pages: what the service learned from demonstrations and why it failed, for people in a browser."""
