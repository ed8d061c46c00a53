"""Which front end a configuration asks for: here slam and the enrichment meet."""

from __future__ import annotations

from typing import TYPE_CHECKING

from slam.data.errors import InputError

if TYPE_CHECKING:
    from slam.data.dataset import Dataset
    from slam.front_end import FrontEnd
    from slam.settings import FrontEndSettings


def front_end_for(settings: FrontEndSettings, data: Dataset) -> FrontEnd:
    """The rings that are there, or, for input enriched, what fills them in. Raises InputError as `RingFrontEnd` does,
    where nobody knows the laser lines that are to be filled in, and where there is no method of that name."""
    from slam.front_end import RingFrontEnd

    measured = RingFrontEnd(settings, data.sensor)
    if settings.input != "enriched":
        return measured
    if data.sensor is None:
        raise InputError(
            f"{data.path}: to enrich its scans the laser lines have to be known; "
            "name the LiDAR: --sensor hdl64, --sensor vlp16 or --sensor FILE.yaml with its beams"
        )
    from enrichment.enricher import Enricher
    from enrichment.methods.registry import METHODS

    target = data.sensor if data.sensor.ring_count == 64 else None
    method = METHODS.load(settings.enricher)()
    return Enricher(measured, method, *measured.lines(), target, coverage=settings.coverage)
