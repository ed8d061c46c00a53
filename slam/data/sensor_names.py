"""The LiDARs that are built in, by name."""

from __future__ import annotations

from typing import TYPE_CHECKING

from slam.data.registry import Registry

if TYPE_CHECKING:
    from slam.data.sensor import Sensor

#: Each a function without arguments.
SENSORS: Registry[Sensor] = Registry(
    "sensor",
    {
        "hdl64": "slam.data.sensor_tables:hdl64",
        "vlp16": "slam.data.sensor_tables:vlp16",
        "hdl32": "slam.data.sensor_tables:hdl32",
        "vlp32c": "slam.data.sensor_tables:vlp32c",
        "vls128": "slam.data.sensor_tables:vls128",
        "os1-64": "slam.data.sensor_tables:os1_64",
        "os1-128": "slam.data.sensor_tables:os1_128",
    },
)
