"""`python -m lidarlift` is `lidarlift`."""

from lidarlift.cli import main

main()
