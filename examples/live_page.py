"""The live page during a session of three sweeps, seen in headless Chromium: the pictures of docs/acquisition.md.

    python examples/live_page.py [FOLDER]

The simulated cell is milled in the three immersions of a plan. The three recordings are then replayed one after the
other, four times as fast as they were, with the page open. Needs playwright and Chromium.
"""

import math
import shutil
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from PIL import Image

from millfrf.steps.plan import plan_from_file

if TYPE_CHECKING:
    from playwright.sync_api import Browser

SPEED = 4.0
SESSION = """
title = "{title}"
{duration}
band_hz = [5.0, 60.0]

[cutting]
teeth = 2
diameter_m = 0.0127
ktc_pa = 119e6
krc = 0.17
kac = 0.33
start_angle_deg = {start}
exit_angle_deg = {leave}
feed_per_tooth_m = 0.00015

[plan]
band_hz = [14.0, 24.0]
depth_m = 0.002
resolution_hz = 0.25
acceleration_noise = 5e-4
frf_error_m_per_n = 1e-6
immersion_widths_deg = [45]

[device]
{device}
"""


def write_session(path: Path, immersion: tuple[float, float], device: str, seconds: float | None = None) -> None:
    """A session with a plan, an immersion, a device and a duration; a replay is over when its file is."""
    title = f"posture A, immersion {immersion[0]:.4g} to {immersion[1]:.4g} degrees"
    start, leave = immersion
    duration = "" if seconds is None else f"duration_s = {seconds}"
    path.write_text(SESSION.format(title=title, start=start, leave=leave, duration=duration, device=device))


def planned(folder: Path) -> tuple[list[tuple[float, float]], float]:
    """Immersions (degrees) and duration (s) of the plan."""
    write_session(folder / "plan.toml", (0.0, 180.0), 'driver = "simulated"')
    plan = plan_from_file(folder / "plan.toml")[0]
    immersions = [(math.degrees(each.start_angle), math.degrees(each.exit_angle)) for each in plan.processes]
    return immersions, plan.duration


def record(folder: Path, immersions: list[tuple[float, float]], duration: float) -> list[Path]:
    """Mill the sweeps with the simulated cell, as fast as it goes."""
    result = []
    for number, immersion in enumerate(immersions, 1):
        session, out = folder / f"mill{number}.toml", folder / f"milled{number}.h5"
        write_session(session, immersion, f'driver = "simulated"\nspeed = 1000.0\nseed = {number}', duration)
        out.unlink(missing_ok=True)
        subprocess.run([sys.executable, "-m", "millfrf", "acquire", str(session), "--out", str(out)], check=True)
        result.append(out)
    return result


def replay(browser: "Browser", session: Path, out: Path, pictures: dict[str, float], duration: float) -> None:
    """Replay a recording with the page open, and take pictures at shares of its duration; 1: when it has ended."""
    command = [sys.executable, "-m", "millfrf", "acquire", str(session), "--out", str(out), "--live"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    url = next(line.split()[-1] for line in process.stdout if "live page" in line)
    page = browser.new_page(viewport={"width": 1500, "height": 1180})
    page.goto(url)
    page.get_by_text("waiting", exact=True).wait_for()
    page.wait_for_timeout(3000)  # the tests before are read
    page.get_by_role("button", name="Start").click()
    spent = 0.0
    for name, share in pictures.items():
        page.wait_for_timeout(1000 * (share * duration / SPEED - spent))
        spent = share * duration / SPEED
        if share == 1.0:
            page.get_by_text("ended", exact=True).wait_for()
        page.screenshot(path=str(out.parent / name), full_page=True)
        with Image.open(out.parent / name) as picture:
            picture.quantize(128).save(out.parent / name, optimize=True)
    page.close()
    process.wait()


def main() -> None:
    from playwright.sync_api import sync_playwright

    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "live_page")
    session = folder / "session"
    session.mkdir(parents=True, exist_ok=True)
    for earlier in session.glob("*.h5"):
        earlier.unlink()
    immersions, duration = planned(folder)
    milled = record(folder, immersions, duration)
    wanted: list[dict[str, float]] = [{}, {}, {"live_page_third.png": 0.6, "live_page_end.png": 1.0}]
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        for number, (immersion, path, pictures) in enumerate(zip(immersions, milled, wanted, strict=True), 1):
            file = folder / f"replay{number}.toml"
            write_session(file, immersion, f'driver = "replay"\nfile = "{path.name}"\nspeed = {SPEED}')
            replay(browser, file, session / f"sweep{number}.h5", pictures, duration)
        browser.close()
    print(f"pictures in {session}")


if __name__ == "__main__":
    main()
