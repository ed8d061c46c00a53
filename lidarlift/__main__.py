"""Run the command `lidarlift` as `python -m lidarlift`."""

from lidarlift.cli import main

main()
