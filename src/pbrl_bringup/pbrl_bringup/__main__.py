"""`python -m pbrl_bringup`: what `./pbrl` hands over to."""

from pbrl_bringup.cli import main

main()
