"""lidarlift's SLAM: from data sets to trajectory and map."""

from pathlib import Path

from slam.kernel_cache import ensure_kernel_cache

ensure_kernel_cache(Path(__file__).parent)
