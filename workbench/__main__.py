"""`python -m workbench`: the command line, also of a checkout that is not installed."""

from workbench.cli import main

if __name__ == "__main__":
    main()
