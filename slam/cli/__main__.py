"""`python -m slam.cli` is `lidarlift`."""

from slam.cli import main

main()
