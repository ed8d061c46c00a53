"""The picture of the README: a simulated scan at 16 channels, enriched and at 64, from above.

python -m benchmarks.enriched.readme_picture [docs/enriched.png]
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from benchmarks.common.script import parser, run_script
from benchmarks.common.simulated import scene
from lidarlift.front_ends import front_end_for
from slam.config import load_config
from slam.data.plot_style import save_png

FRAME, REACH = 100, 22  # m ahead, behind and to both sides
TITLES = {"16": "16 channels", "enriched": "enriched, by sigma", "64": "64 channels"}
MOST = 0.5  # m of sigma, the brightest colour


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("file", nargs="?", type=Path, default=Path("docs/enriched.png"))
    options = arguments.parse_args()
    data = scene("loop")
    frame = data[FRAME]
    figure = Figure(figsize=(13, 4.6), facecolor="white", layout="constrained")
    axes = figure.subplots(1, 3)
    for axis, (name, title) in zip(axes, TITLES.items(), strict=True):
        settings = load_config(input=name, enricher="ray-segment").front_end
        cloud = front_end_for(settings, data.sensor, data.path)(frame, ())
        cloud = cloud.select((np.abs(cloud.xyz[:, :2]) < REACH).all(axis=1) & (cloud.xyz[:, 2] < 2.5))
        new = cloud.select(~cloud.measured)
        dots = axis.scatter(*new.xyz[:, :2].T, c=new.sigma, s=0.6, lw=0, cmap="plasma", vmin=0, vmax=MOST)
        axis.scatter(*cloud.xyz[cloud.measured, :2].T, c="#d8e4ec", s=0.6, lw=0)
        axis.set(aspect="equal", xlim=(-REACH, REACH), ylim=(-REACH, REACH), facecolor="#101010")
        axis.set_title(f"{title}: {len(cloud):,} points", color="#222222", fontsize=11, loc="left")
        axis.tick_params(colors="#555555", labelsize=8)
        if len(new):
            bar = figure.colorbar(dots, ax=list(axes), pad=0.01, shrink=0.9)
            bar.set_label("sigma of the predicted points [m]", color="#222222", fontsize=8)
            bar.ax.tick_params(colors="#555555", labelsize=8)
    save_png(figure, options.file, dpi=100)


if __name__ == "__main__":
    run_script(main)
