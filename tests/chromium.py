"""The system's Chromium: where it is, and how it draws."""

import shutil

# Mesa's software rendering through EGL draws WebGL two to three times faster than the browser's
# own; but put together by it, too, a page would cost twice the processor time.
ARGUMENTS = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=gl-egl",
    "--ignore-gpu-blocklist",
    "--disable-gpu-compositing",
]


def find_browser() -> str | None:
    """The path of the browser; None where there is none. The one without a window of its own, where
    it is installed, is half the work to start."""
    names = ("chromium-headless-shell", "chromium", "chromium-browser")
    return next(filter(None, map(shutil.which, names)), None)
