"""How often does a wrong recording or scene move the robot wrongly, without a danger? See `__main__`."""
