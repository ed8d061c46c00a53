"""The README's figure: milliseconds per frame against distance to the dense trajectory, one panel per drive."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from slam.data.plot_style import BLUE, GREEN, GREY, PURPLE, SKY_BLUE, VERMILION, save_png, tidy

STYLES = {
    "ndt": ("lidarlift", BLUE, "o"),
    "ndt-scan-to-scan": ("lidarlift, scan to scan", SKY_BLUE, "o"),
    "kiss-icp": ("KISS-ICP", VERMILION, "s"),
    "vgicp": ("small_gicp VGICP", GREEN, "^"),
    "gicp": ("small_gicp GICP", PURPLE, "v"),
    "point-to-plane": ("Open3D point-to-plane", GREY, "D"),
}


def draw(results: dict[str, Any], path: Path) -> None:
    """Write the PNG from [dataset][system][channels].{median_ms, dense_m}; systems that failed are left out."""
    figure = Figure(figsize=(4.2 * len(results), 4.4), layout="constrained")
    panels = figure.subplots(1, len(results), sharey=True, squeeze=False)[0]
    for axes, (drive, systems) in zip(panels, results.items(), strict=True):
        _panel(axes, drive, systems)
    panels[0].set_ylabel("distance to a dense trajectory [cm]")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(STYLES) // 2, frameon=False)
    save_png(figure, path, dpi=130)


def _panel(axes: Axes, drive: str, systems: dict[str, Any]) -> None:
    for name, (label, colour, marker) in STYLES.items():
        entries = {channels: entry for channels, entry in systems[name].items() if entry.get("dense_m")}
        x = [entry["median_ms"] for entry in entries.values()]
        y = [100 * entry["dense_m"] for entry in entries.values()]
        axes.plot(x, y, color=colour, linewidth=0.8, alpha=0.5)
        for channels, left, right in zip(entries, x, y, strict=True):
            full = channels == "64"
            face = colour if full else "white"
            axes.plot(left, right, marker, color=colour, markerfacecolor=face, label=label if full else None)
    axes.set(xscale="log", yscale="log", xlim=(2.5, 150), xlabel="milliseconds a frame, one thread")
    axes.set_title(f"{drive}\n64 channels filled, 16 hollow", fontsize=10)
    axes.set_xticks([5, 10, 20, 50, 100], ["5", "10", "20", "50", "100"])
    axes.set_yticks([1, 3, 10, 30, 100, 300], ["1", "3", "10", "30", "100", "300"])
    axes.minorticks_off()
    tidy(axes)
