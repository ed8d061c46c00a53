"""The folder of the compiled kernels where neither the package nor the user's cache can be written."""

from __future__ import annotations

import os
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"


def ensure_kernel_cache(package: Path) -> None:
    """Give numba a temporary folder for compiled kernels if it has no other; it would refuse to import them.

    numba writes beside the code, or into the user's cache. To be called before numba is imported.

    Args:
        package: Folder of the code.
    """
    if VARIABLE in os.environ or _writable(package) or _writable(_user_cache()):
        return
    import atexit
    import logging
    import shutil
    from tempfile import mkdtemp

    folder = mkdtemp(prefix="lidarlift-kernels-")
    os.environ[VARIABLE] = folder
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    logging.getLogger("lidarlift").warning(
        "neither %s nor %s can be written: each process compiles the kernels; set %s to a folder that keeps them",
        package, _user_cache(), VARIABLE,
    )  # fmt: skip


def _user_cache() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser()


def _writable(folder: Path) -> bool:
    """Whether the folder can be written, or be made if there is none."""
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    return folder.is_dir() and os.access(folder, os.W_OK | os.X_OK)
