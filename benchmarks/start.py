"""From nothing to a picture: python benchmarks/start.py [SCENE ...] [--whole] [--json].

For each scene of the gallery, or those named: the time from the shell to the first still of
`motes run` with an empty kernel cache, and with what that run has kept; `--whole` also waits for
the film. `motes demo` makes the film of the sprinkler. First come the bare command and the import,
and the time in which a scene is running again after a force is taken away.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from _report import Report, arguments, best, machine

from motes.scene.gallery import gallery

MOTES = [sys.executable, "-c", "from motes.cli import main; main()"]

CHANGED = """
import motes
scene = motes.load("sprinkler").document()
scene["force"] = []
motes.Simulation(motes.scene.from_document(scene)).run(until=0.1)
"""


def shell(command: list[str], cache: Path) -> float:
    """Seconds that a command takes."""
    begin = time.perf_counter()
    subprocess.run(command, check=True, capture_output=True, env=environment(cache))
    return time.perf_counter() - begin


def environment(cache: Path) -> dict[str, str]:
    """The environment with a kernel cache of its own."""
    return {**os.environ, "MOTES_CACHE": str(cache)}


def film(scene: str, cache: Path, folder: Path, whole: bool) -> tuple[float, float]:
    """Seconds to the first still, and to the end of the film, or of what was waited for."""
    shutil.rmtree(folder, ignore_errors=True)
    still, begin = folder / f"{scene}.png", time.perf_counter()
    command = [*MOTES, "run", scene, "-o", str(folder), "--quiet"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, env=environment(cache)) as process:
        while not still.exists() and process.poll() is None:
            time.sleep(0.01)
        first = time.perf_counter() - begin
        if not still.exists():
            raise SystemExit(f"{scene}: {process.stderr.read().decode()}")  # type: ignore[union-attr]
        if whole:
            process.communicate()
        else:
            process.kill()
    return first, time.perf_counter() - begin


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("scene", nargs="*", help="names of the gallery; else all")
    parser.add_argument("--whole", action="store_true", help="wait for the films, too")
    options = parser.parse_args()
    report = Report("Time from the shell [s]", machine=machine())

    def add(name: str, value: float) -> None:
        report.figures[name] = value, "s"

    with tempfile.TemporaryDirectory() as place:
        cache, folder = Path(place) / "cache", Path(place) / "film"
        add("motes --help", best(lambda: shell([*MOTES, "--help"], cache), 5))
        add("import motes", best(lambda: shell([sys.executable, "-c", "import motes"], cache), 5))
        for scene in options.scene or (["sprinkler"] if options.quick else sorted(gallery())):
            shutil.rmtree(cache, ignore_errors=True)
            for state in ("cold", "warm"):
                first, done = film(scene, cache, folder, options.whole)
                add(f"{scene}, {state}: first still", first)
                if options.whole:
                    add(f"{scene}, {state}: film", done)
            if scene == "sprinkler":
                add(
                    "sprinkler without gravity runs again",
                    shell([sys.executable, "-c", CHANGED], cache),
                )
    report.print(options.json)


if __name__ == "__main__":
    main()
