"""`python -m mission`: the same program as `mission`."""

from mission.cli.main import main

if __name__ == "__main__":
    raise SystemExit(main())
