"""Enrich one scan and draw it from above: measured points in black, predicted points coloured by their sigma.

python examples/enrich_a_scan.py my_scans --sensor vlp16 --scan 10 --enricher ray-segment --out scan.png
"""

from __future__ import annotations

import argparse

from matplotlib.figure import Figure

import lidarlift

REACH = 30  # m, shown ahead, behind and to both sides


def main() -> None:
    """Enrich one scan and draw it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("dataset", help="KITTI, or a folder of scans")
    parser.add_argument("--sensor", help="the LiDAR, where the folder does not say: vlp16, ... or a YAML file")
    parser.add_argument("--scan", type=int, default=0, help="position in the data set")
    parser.add_argument("--enricher", default="ray-segment")
    parser.add_argument("--out", default="scan.png", help="the picture")
    options = parser.parse_args()

    data = lidarlift.open_dataset(options.dataset, sensor=options.sensor)
    one = slice(options.scan, options.scan + 1)
    ((frame, cloud),) = lidarlift.enrich(data, enricher=options.enricher, frames=one)
    predicted = cloud.select(~cloud.measured)
    print(f"Scan {frame.index}: {cloud.measured.sum()} points measured, {len(predicted)} predicted")

    figure = Figure(figsize=(8, 7), layout="constrained")
    axes = figure.add_subplot(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    axes.set(xlim=(-REACH, REACH), ylim=(-REACH, REACH))
    dots = axes.scatter(*predicted.xyz[:, :2].T, c=predicted.sigma, s=1, lw=0, cmap="plasma", vmin=0, vmax=0.5)
    axes.scatter(*cloud.xyz[cloud.measured, :2].T, c="black", s=1, lw=0)
    axes.set_title(f"{data.name}, scan {frame.index}, {options.enricher}")
    figure.colorbar(dots, label="sigma of the predicted points [m]")
    figure.savefig(options.out, dpi=150)
    print(f"Picture: {options.out}")


if __name__ == "__main__":
    main()
