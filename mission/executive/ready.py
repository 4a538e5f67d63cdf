"""Draws and looks once before anything flies, so that inner loops are compiled by then: seconds, once on a machine.

`python -m mission.executive.ready MISSION` does so at set-up.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from devices.world.world import World
    from mission.language.document import Mission
    from vision.camera import RigGeometry


FRAMING = ("follow_edge", "climb_tower")
"""Behaviours that leave pictures in the record."""


def takes_images(mission: Mission) -> bool:
    """Whether any state of the mission looks through the cameras."""
    from mission.behaviours.behaviour import behaviours

    done = [state.do for state in mission.states.values() if state.do is not None]
    return any(name in FRAMING or behaviours()[name].needs_vision for name in done)


def make_ready(world: World | None, geometry: RigGeometry) -> None:
    """Compile what the simulated world, if there is one, and the eye of this rig run. Blocks."""
    from vision.pipeline import Eye
    from vision.warm_up import warm_up

    if world is not None:
        _ = world.renderer
    warm_up(Eye(geometry))


def main() -> None:
    """Make ready for the mission that the command line names, and for photographs."""
    from mission.executive.belief import rig_geometry
    from mission.executive.simulation import build_world
    from mission.language.document import load
    from vision.pipeline import observe_single
    from vision.warm_up import specimen

    print("compiling inner loops: about a minute, once on a machine", flush=True)
    mission = load(Path(sys.argv[1]))
    geometry = rig_geometry(mission.rig, mission.path.parent)
    make_ready(build_world(mission), geometry)
    photograph = specimen(geometry).left_laser
    assert photograph is not None
    observe_single(photograph)


if __name__ == "__main__":
    main()
