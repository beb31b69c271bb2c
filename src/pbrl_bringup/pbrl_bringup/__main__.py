"""`python -m pbrl_bringup`: what `./pbrl` hands over to."""

from pbrl_bringup.cli.app import main

main()
