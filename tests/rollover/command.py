"""The command `rollover` as a module, for tests that need a process of its own."""

from rollover.cli.main import main

if __name__ == "__main__":
    main()
