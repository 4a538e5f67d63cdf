"""`python -m devices.vehicle --config FILE`: the simulated vehicle as a process; its ports appear on stdout as JSON."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from pydantic import ValidationError

from devices.vehicle.settings import ProcessSettings


def main() -> int:
    """Run until stopped; 2 with one line on stderr when the file, a port or the folder is not right."""
    parser = argparse.ArgumentParser(prog="python -m devices.vehicle", description=__doc__)
    parser.add_argument("--config", type=Path, required=True, help="JSON file of ProcessSettings; - reads stdin")
    path: Path = parser.parse_args().config
    try:
        text = sys.stdin.read() if str(path) == "-" else path.read_text(encoding="utf-8")
        settings = ProcessSettings.model_validate_json(text)
    except OSError as error:
        print(f"{path}: {error.strerror}", file=sys.stderr)
        return 2
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        print(f"{path}: {where}: {first['msg']} (got {first['input']!r})", file=sys.stderr)
        return 2
    from devices.vehicle.process import serve
    from devices.vehicle.udp_link import PortInUseError

    try:
        serve(settings)
    except PortInUseError as error:
        print(error, file=sys.stderr)
        return 2
    except OSError as error:
        print(f"{settings.folder}: {error.strerror or error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
