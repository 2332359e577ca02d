"""``python -m avow.cli``."""

from avow.cli import main

main()
