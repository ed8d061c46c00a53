"""The picture of docs/report.md: the top of a comparison's report, in a browser.

python -m benchmarks.enriched.report_picture [docs/report.jpg]

Runs the quick demo in a temporary folder, and opens its report in Debian's chromium without a window.
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from benchmarks.common.script import parser, run_script
from lidarlift.cli.demo import demo
from slam.data.atomic import written_beside
from slam.data.errors import InputError

SIZE, QUALITY = (1280, 1100), 82
TIME = 20_000  # ms of the page's own time until the picture is taken


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("file", nargs="?", type=Path, default=Path("docs/report.jpg"))
    options = arguments.parse_args()
    browser = shutil.which("chromium")
    if browser is None:
        raise InputError("chromium is not installed: apt-get install chromium")
    with TemporaryDirectory() as folder:
        out, picture = Path(folder) / "demo", Path(folder) / "report.png"
        demo(out, quick=True)
        window = f"--window-size={SIZE[0]},{SIZE[1]}"
        flags = ["--headless", "--no-sandbox", "--hide-scrollbars", window, f"--virtual-time-budget={TIME}"]
        page = (out / "report.html").resolve().as_uri()
        subprocess.run([browser, *flags, f"--screenshot={picture}", page], check=True, capture_output=True)
        with written_beside(options.file) as file:
            Image.open(picture).convert("RGB").save(file, "JPEG", quality=QUALITY)


if __name__ == "__main__":
    run_script(main)
