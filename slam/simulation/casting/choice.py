"""Selection of the ray caster that is available on this system."""

from __future__ import annotations

from slam.simulation.casting.embree import has_packets

if has_packets():
    from slam.simulation.casting.caster import RayCaster
    from slam.simulation.casting.embree import TriangleScene
else:
    from slam.simulation.casting.open3d_rays import RayCaster, TriangleScene  # type: ignore[assignment]

__all__ = ["RayCaster", "TriangleScene"]
