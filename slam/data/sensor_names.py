"""Registry of the built-in LiDARs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from slam.data.registry import Registry

if TYPE_CHECKING:
    from slam.data.sensor import Sensor

#: Factories without arguments.
SENSORS: Registry[Sensor] = Registry(
    "sensor",
    {
        "hdl64": "slam.data.sensor_tables:hdl64",
        "vlp16": "slam.data.sensor_tables:vlp16",
        "hdl32": "slam.data.sensor_tables:hdl32",
        "vlp32c": "slam.data.sensor_tables:vlp32c",
        "vls128": "slam.data.sensor_tables:vls128",
        "puck-hires": "slam.data.sensor_tables:puck_hires",
        "os0-16": "slam.data.sensor_tables:os0_16",
        "os0-32": "slam.data.sensor_tables:os0_32",
        "os0-64": "slam.data.sensor_tables:os0_64",
        "os0-128": "slam.data.sensor_tables:os0_128",
        "os1-16": "slam.data.sensor_tables:os1_16",
        "os1-32": "slam.data.sensor_tables:os1_32",
        "os1-64": "slam.data.sensor_tables:os1_64",
        "os1-128": "slam.data.sensor_tables:os1_128",
        "os2-16": "slam.data.sensor_tables:os2_16",
        "os2-32": "slam.data.sensor_tables:os2_32",
        "os2-64": "slam.data.sensor_tables:os2_64",
        "os2-128": "slam.data.sensor_tables:os2_128",
        "pandar40p": "slam.data.sensor_tables:pandar40p",
        "pandar64": "slam.data.sensor_tables:pandar64",
        "xt16": "slam.data.sensor_tables:xt16",
        "xt32": "slam.data.sensor_tables:xt32",
        "qt64": "slam.data.sensor_tables:qt64",
        "rs-16": "slam.data.sensor_tables:rs16",
        "rs-32": "slam.data.sensor_tables:rs32",
        "rs-helios": "slam.data.sensor_tables:rs_helios",
        "rs-ruby": "slam.data.sensor_tables:rs_ruby",
        "rs-bpearl": "slam.data.sensor_tables:rs_bpearl",
    },
)
