"""Registry of the built-in drives."""

from __future__ import annotations

from typing import TYPE_CHECKING

from slam.data.registry import Registry

if TYPE_CHECKING:
    from slam.simulation.drives import Drive

#: Each takes the spacing of its frames [m], None for ten frames a second.
DRIVES: Registry[Drive] = Registry(
    "drive",
    {
        "loop": "slam.simulation.drives:loop",
        "straight": "slam.simulation.drives:straight",
        "tunnel": "slam.simulation.drives:tunnel",
        "jam": "slam.simulation.drives:jam",
        "crawl": "slam.simulation.drives:crawl",
        "motorway": "slam.simulation.drives:motorway",
        "bridge": "slam.simulation.drives:bridge",
        "lorries": "slam.simulation.drives:lorries",
        "traffic": "slam.simulation.drives:traffic",
        "building": "slam.simulation.indoors.walk:building",
    },
)
