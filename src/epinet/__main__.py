"""`python -m epinet` is the command line."""

from epinet.cli import main

main()
