"""`python -m app.cli`, where the script `roboprompt` is not on the path."""

from app.cli import main

main()
