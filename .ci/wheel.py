"""Build the wheel and test it as a user gets it: with its dependencies, and nothing else.

Example: .venv/bin/python .ci/wheel.py dist

The environment is a new one whose packages are links to those of the environment that runs this, so that nothing large
is installed twice; test tools and torch are not among them. There, and far from the repository, the demo runs.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import venv
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from zipfile import ZipFile

from packaging.requirements import Requirement

REPOSITORY = Path(__file__).resolve().parents[1]
FOLDERS = {
    "lidarlift": "lidarlift",
    "slam": "slam",
    "enrichment": "enrichment",
    "eval": "eval",
    "configs": "slam/presets",
}
NOT_THERE = ("torch", "lightning", "onnx", "pytest_cov", "hypothesis", "mypy")  # what only training and tests need


def main(out: Path) -> None:
    run(sys.executable, "-m", "build", "--quiet", "--outdir", out, REPOSITORY)
    wheel = max(out.glob("lidarlift-*.whl"), key=lambda path: path.stat().st_mtime)
    check_contents(wheel)
    with tempfile.TemporaryDirectory(prefix="lidarlift-wheel-") as name:
        folder = Path(name)
        site = environment(folder / "env", wheel)
        python, command = (folder / "env" / "bin" / program for program in ("python", "lidarlift"))
        run(sys.executable, "-m", "pip", "--python", python, "check")
        for module in NOT_THERE:
            assert not (site / module).exists(), f"{module} came along"
        os.environ["XDG_CACHE_HOME"] = str(folder / "cache")
        run(python, "-c", "import lidarlift; assert 'site-packages' in lidarlift.__file__", cwd=folder)
        run(command, "--help", cwd=folder, stdout=subprocess.DEVNULL)
        run(command, "demo", "--quick", cwd=folder)
        shutil.rmtree(site / "enrichment" / "weights")  # whose licence is not for everybody
        run(
            command,
            "run",
            folder / "cache" / "lidarlift" / "demo",
            *["--frames", "0:5", "--input", "enriched"],
            cwd=folder,
        )
    print(f"{wheel}: whole; runs without torch, and without the networks' weights")


def check_contents(wheel: Path) -> None:
    """Check that the wheel contains the files that git tracks, and no others."""
    tracked = subprocess.check_output(["git", "ls-files", *FOLDERS], cwd=REPOSITORY, text=True).splitlines()
    expected = {
        file.replace("configs/", "slam/presets/", 1) if file.startswith("configs/") else file for file in tracked
    }
    found = {file for file in ZipFile(wheel).namelist() if ".dist-info/" not in file}
    assert found == expected, f"{wheel}: missing {expected - found}, unexpected {found - expected}"


def environment(folder: Path, wheel: Path) -> Path:
    """A new environment with the wheel and links to what it asks for; returns its site-packages."""
    venv.create(folder, symlinks=True)
    run(sys.executable, "-m", "pip", "--python", folder / "bin" / "python", "install", "-q", "--no-deps", wheel)
    (site,) = folder.glob("lib/python*/site-packages")
    (lidarlift,) = metadata.distributions(path=[str(site)])
    for distribution in {found.name: found for found in required(lidarlift, set(), set())}.values():
        for top in {file.parts[0] for file in distribution.files or () if file.parts[0] not in ("..", "__pycache__")}:
            if not (site / top).exists():
                (site / top).symlink_to(Path(str(distribution.locate_file(top))).resolve())
    return site


def required(distribution: metadata.Distribution, extras: set[str], seen: set[str]) -> Iterator[metadata.Distribution]:
    """Return the requirements of a package with these extras, and their requirements in turn."""
    for requirement in map(Requirement, distribution.requires or ()):
        marker, wanted = requirement.marker, {"", *extras}
        if (marker and not any(marker.evaluate({"extra": extra}) for extra in wanted)) or str(requirement) in seen:
            continue
        seen.add(str(requirement))
        found = metadata.distribution(requirement.name)
        yield found
        yield from required(found, requirement.extras, seen)


def run(*command: object, cwd: Path = REPOSITORY, stdout: int | None = None) -> None:
    print("+", *command, flush=True)
    subprocess.run([str(word) for word in command], check=True, cwd=cwd, stdout=stdout)


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
