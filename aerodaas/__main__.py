"""`python -m aerodaas` is the command line."""

from aerodaas.cli.app import main

main()
