"""`python -m aerodaas` is the command line."""

from aerodaas.cli import main

main()
