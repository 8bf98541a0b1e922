"""The commands, as `python -m rollover`."""

from rollover.cli.main import main

if __name__ == "__main__":
    main()
