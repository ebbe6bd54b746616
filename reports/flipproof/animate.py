"""The flights as a film: the page's player as GIF or MP4.

Every frame is drawn by matplotlib, as the report's figures are; a GIF is written by Pillow, which matplotlib brings
along, an MP4 by the program ffmpeg, which must be on the PATH.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from flipproof.figures.film import Film, Picture, draw_frames
from flipproof.page.motion import flight_of, frame_times
from flipproof.sweep.files import whole_file
from slicemodel import Scenario, Trajectory
from slicemodel.scenario import shortened
from slicemodel.trajectory import FloatArray

if TYPE_CHECKING:
    from PIL.Image import Image

MOST_FRAMES: Final = 3000
"""Frames of a film at the most; a GIF holds them all in memory."""

HOLD: Final = 1.0
"""Seconds that the last frame stays."""

ENCODER: Final = "ffmpeg"

Step = Callable[[int, int], None]
"""Called with frames drawn and frames of the film."""


class FilmError(ValueError):
    """The film cannot be made as asked; the message says why and what to do."""


def check_pace(slow: float, fps: int) -> None:
    """Refuse by a FilmError a film slower or faster than can be shown; a GIF counts in hundredths of a second."""
    if not (np.isfinite(slow) and slow > 0):
        raise FilmError(f"--slow {slow:g} is outside (0, inf): 1 is real time, 9.6 the paper's slow motion")
    if not 1 <= fps <= 50:
        raise FilmError(f"--fps {fps} is outside [1, 50] frames per second")


def plan_film(throw: Scenario, slow: float, fps: int) -> FloatArray:
    """Return the times of flight that the frames show, from release to landing, shape (F,) [s].

    A number out of range or a film that would be too long raises a FilmError.
    """
    check_pace(slow, fps)
    frames = throw.duration * slow * fps + 1
    if frames > MOST_FRAMES:
        raise FilmError(f"--slow {slow:g} at --fps {fps} makes {frames:.4g} frames (admissible: at most {MOST_FRAMES})")
    return frame_times(throw, max(round(frames), 2))


def film_of(runs: Sequence[Trajectory], t: FloatArray, *, fps: int, slow: float) -> Film:
    """Return the film of some runs of one throw, shown at times of flight ``t``."""
    return Film(throw=runs[0].scenario, t=t, flights=tuple(flight_of(run, t) for run in runs), fps=fps, slow=slow)


def check_target(path: Path) -> None:
    """Refuse by a FilmError a file that could not be written after all the work.

    Its name has another ending, its folder is not there, it is a folder, or ffmpeg is needed and missing.
    """
    if path.suffix.lower() not in (".gif", ".mp4"):
        raise FilmError(f"--out {path}: the name ends in {path.suffix or 'nothing'} (admissible: .gif, .mp4)")
    if path.is_dir():
        raise FilmError(f"--out {path} is a folder; name a file")
    if not path.parent.is_dir():
        raise FilmError(f"--out {path}: the folder {path.parent} does not exist")
    if path.suffix.lower() == ".mp4" and shutil.which(ENCODER) is None:
        raise FilmError(
            f"--out {path}: MP4 needs the program {ENCODER}, which is not on the PATH; install it, or name a .gif"
        )


def write_film(film: Film, path: Path, step: Step) -> None:
    """Draw every frame and write the film; ``path`` is as it was until the new film is whole.

    A path that will not do, or an ffmpeg that fails, raises a FilmError.
    """
    write_pictures(draw_frames(film), len(film.t), film.fps, path, step)


def write_pictures(pictures: Iterator[Picture], count: int, fps: int, path: Path, step: Step) -> None:
    """Write ``count`` pictures as a film; errors as of ``write_film``."""

    def counted() -> Iterator[Picture]:
        for k, picture in enumerate(pictures, start=1):
            yield picture
            step(k, count)

    check_target(path)
    with whole_file(path) as part:
        if path.suffix.lower() == ".gif":
            _write_gif(counted(), frame_durations(count, fps), part)
        else:
            _write_mp4(counted(), fps, part)


def frame_durations(count: int, fps: int) -> list[int]:
    """Return how long each frame of a GIF stays [ms]: whole hundredths of a second that together keep the pace."""
    ends = [10 * round(100 * (k + 1) / fps) for k in range(count)]
    stays = [end - begin for begin, end in zip([0, *ends], ends, strict=False)]
    stays[-1] += round(1000 * HOLD)
    return stays


def _write_gif(frames: Iterator[Picture], stays: list[int], path: Path) -> None:
    from PIL import Image

    first = Image.fromarray(next(frames))
    # One palette for all frames: those of each alone would flicker, and make the file twice as large.
    palette = _palette(first)

    def with_palette(picture: Image.Image) -> Image.Image:
        return picture.quantize(palette=palette, dither=Image.Dither.NONE)

    others = (with_palette(Image.fromarray(frame)) for frame in frames)
    settings: dict[str, Any] = {"append_images": others, "duration": stays, "loop": 0, "optimize": False}
    with path.open("wb") as file:  # Pillow would leave a file of its own open when interrupted
        with_palette(first).save(file, format="GIF", save_all=True, **settings)


def _palette(picture: Image) -> Image:
    """Return an image with a palette of 128 colours fit for ``picture``, the background's exactly among them.

    Colours whose channels differ from the background's by less than 20 are the background. Pillow looks a colour up by
    the corner of its box of 8 levels, and nothing else may be nearer to that than the background is.
    """
    from PIL import Image

    fit = picture.quantize(colors=128, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    colours = np.array(fit.getpalette()).reshape(-1, 3)
    wanted = np.array(picture.getpixel((0, 0)))
    # The median of a box of nearly white colours is not white, and the page around the film would show it.
    colours[np.abs(colours - wanted).max(axis=1) < 20] = wanted
    made = Image.new("P", (1, 1))
    made.putpalette(colours.ravel().tolist())
    return made


def _write_mp4(frames: Iterator[Picture], fps: int, path: Path) -> None:
    first = next(frames)
    height, width, _ = first.shape
    command = [
        ENCODER, "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}",
        "-r", str(fps), "-i", "-", "-an", "-vf", f"tpad=stop_mode=clone:stop_duration={HOLD:g}",
        "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4", str(path),
    ]  # fmt: skip
    with tempfile.TemporaryFile() as said, _running(command, said) as process:
        assert process.stdin is not None
        with suppress(BrokenPipeError):  # what it said tells why
            for frame in chain([first], frames):
                process.stdin.write(frame.tobytes())
            process.stdin.close()
        if process.wait() != 0:
            said.seek(0)
            # The end tells why it failed.
            words = shortened(said.read().decode("utf-8", "replace")[::-1], 300)[::-1]
            raise FilmError(f"{ENCODER} failed with exit status {process.returncode}: {words or 'it said nothing'}")


@contextmanager
def _running(command: Sequence[str], said: Any) -> Iterator[subprocess.Popen[bytes]]:
    """Give a process that does not outlive the block."""
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=said)
    assert process.stdin is not None
    try:
        yield process
    finally:
        with suppress(BrokenPipeError):
            process.stdin.close()
        if process.poll() is None:
            process.kill()
            process.wait()
