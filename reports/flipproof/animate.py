"""The flights as a film, GIF or MP4: bottles in the lab frame above, omega and theta below.

Every frame is drawn by matplotlib, as the report's figures are; a GIF is written by Pillow, which matplotlib brings
along, an MP4 by the program ffmpeg, which must be on the PATH.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from flipproof.figures.style import solver_style, styled
from flipproof.output.files import whole_file
from flipproof.output.motion import Flight, cap_and_base, flight_of, parabola, release_point
from slicemodel import Scenario, Trajectory
from slicemodel.scenario import shortened
from slicemodel.trajectory import FloatArray

if TYPE_CHECKING:
    from PIL.Image import Image

MAX_FRAMES: Final = 3000
"""Frames of a film at the most; a GIF holds them all in memory."""

HOLD: Final = 1.0
"""Seconds that the last frame stays."""

ENCODER: Final = "ffmpeg"

Picture = NDArray[np.uint8]

GLASS: Final = "#57606a"

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
    if frames > MAX_FRAMES:
        raise FilmError(f"--slow {slow:g} at --fps {fps} makes {frames:.4g} frames (admissible: at most {MAX_FRAMES})")
    return np.linspace(0.0, throw.duration, max(round(frames), 2))


@dataclass(frozen=True, slots=True, kw_only=True)
class Film:
    """What is shown, ``slow`` times slower than the flight and with ``fps`` frames in a second.

    ``t`` is the time of flight of every frame, shape (F,) [s]; there is one flight per bottle.
    """

    throw: Scenario
    t: FloatArray
    flights: tuple[Flight, ...]
    fps: int
    slow: float


def film_of(runs: Sequence[Trajectory], t: FloatArray, *, fps: int, slow: float) -> Film:
    """Return the film of some runs of one throw, shown at times of flight ``t``."""
    return Film(throw=runs[0].scenario, t=t, flights=tuple(flight_of(run, t) for run in runs), fps=fps, slow=slow)


def check_target(path: Path, option: str = "--out") -> None:
    """Refuse by a FilmError that names the ``option`` a file that could not be written after all the work.

    Its name has another ending, its folder is not there, it is a folder, or ffmpeg is needed and missing.
    """
    if path.suffix.lower() not in (".gif", ".mp4"):
        raise FilmError(f"{option} {path}: the name ends in {path.suffix or 'nothing'} (admissible: .gif, .mp4)")
    if path.is_dir():
        raise FilmError(f"{option} {path} is a folder; name a file")
    if not path.parent.is_dir():
        raise FilmError(f"{option} {path}: the folder {path.parent} does not exist")
    if path.suffix.lower() == ".mp4" and shutil.which(ENCODER) is None:
        raise FilmError(
            f"{option} {path}: MP4 needs the program {ENCODER}, which is not on the PATH; install it, or name a .gif"
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


def draw_frames(film: Film) -> Iterator[Picture]:
    """Return the frames of a film, one after the other."""
    return pictures(*_scene(film), range(len(film.t)))


def laid_out(figure: Figure) -> Any:
    """Return the canvas of a figure that keeps its layout: to do it again for every frame would make panels tremble."""
    canvas = cast(Any, FigureCanvasAgg(figure))
    canvas.draw()
    figure.set_layout_engine("none")
    return canvas


def pictures(canvas: Any, show: Callable[[Any], None], frames: Iterable[Any]) -> Iterator[Picture]:
    """Yield every frame as red, green and blue, shape (height, width, 3); both sides are even, as MP4 needs.

    ``show`` moves all that is on the canvas to a frame.
    """
    for frame in frames:
        show(frame)
        styled(canvas.draw)()
        picture = np.asarray(canvas.buffer_rgba())
        height, width = (side - side % 2 for side in picture.shape[:2])
        yield np.ascontiguousarray(picture[:height, :width, :3])


@styled
def _scene(film: Film) -> tuple[Any, Callable[[int], None]]:
    """Return a canvas with all that is shown, and what moves it to a frame."""
    count = len(film.flights)
    figure = Figure(figsize=(2.4 * max(count, 2), 5.6), dpi=100, layout="constrained")
    # Laid out apart, so that the labels of the traces leave the panels of the bottles alone.
    above, below = figure.subfigures(2, 1, height_ratios=(1.45, 1.0), squeeze=False)[:, 0]
    panels = list(above.subplots(1, count, squeeze=False)[0])
    ends = [cap_and_base(film.throw, flight) for flight in film.flights]
    moves = [_bottle(axes, film, k, *ends[k]) for k, axes in enumerate(panels)]
    # Every panel has the same window, that of all bottles at all times.
    reached = np.concatenate([end for both in ends for end in both])
    margin = 1.2 * film.throw.bottle.radius
    low, high = reached.min(axis=0) - margin, reached.max(axis=0) + margin
    for axes in panels:
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        axes.set_axis_off()
    left, right = below.subplots(1, 2)
    cursors = [_trace(left, film, "omega"), _trace(right, film, "theta")]
    title = figure.suptitle(" ", fontsize=10, family="monospace")

    def show(k: int) -> None:
        title.set_text(f"t = {film.t[k]:.3f} s, {film.slow:g} times slower")
        for move in moves:
            move(k)
        for cursor in cursors:
            cursor.set_xdata([film.t[k], film.t[k]])

    show(0)
    return laid_out(figure), show


def _bottle(axes: Axes, film: Film, k: int, caps: FloatArray, bases: FloatArray) -> Callable[[int], None]:
    """Draw the ``k``-th bottle; return what moves it to a frame, or to its last one if it ended before."""
    throw, flight = film.throw, film.flights[k]
    colour = solver_style(flight.name, k)["color"]
    centres = parabola(throw, release_point(throw, float(flight.r_cm[0])), film.t)
    axes.plot(centres[:, 0], centres[:, 1], color=GLASS, linestyle=":", linewidth=1.0)
    (path,) = axes.plot([], [], color=colour, linewidth=1.2)
    # From the slice that starts on the base to the one that starts on top.
    first, last = (np.array(to_rgba(tint, 0.5)) for tint in ("#0b5cad", "#35b0c4"))
    shares = np.linspace(0.0, 1.0, max(len(flight.drawn), 1))[:, np.newaxis]
    slices = PolyCollection([], facecolors=[tuple(tint) for tint in first + shares * (last - first)], edgecolors="none")
    axes.add_collection(slices)
    (glass,) = axes.plot([], [], color=GLASS, linewidth=1.4)
    (centre,) = axes.plot([], [], marker="+", markersize=8, markeredgewidth=1.6, color="black")
    status = "" if flight.status == "ok" else f" ({flight.status})"
    axes.set_title(f"{flight.name}{status}", fontsize=10, color=colour)

    def move(frame: int) -> None:
        at = min(frame, len(flight.t) - 1)
        cap = caps[at]
        along = (bases[at] - cap) / throw.bottle.length
        glass.set_data(*outline(throw, cap, along).T)
        slices.set_verts(list(slice_corners(throw, flight.r[at], cap, along)))
        mass = cap + flight.r_cm[at] * along
        centre.set_data([mass[0]], [mass[1]])
        path.set_data(bases[: at + 1, 0], bases[: at + 1, 1])

    return move


def _across(along: FloatArray) -> FloatArray:
    return np.array([-along[1], along[0]])


def outline(throw: Scenario, cap: FloatArray, along: FloatArray) -> FloatArray:
    """Return the bottle's outline with a small cap on it, shape (K, 2) [m]."""
    radius, length = throw.bottle.radius, throw.bottle.length
    wall, neck, base = radius * _across(along), 0.35 * radius * _across(along), length * along
    top = -0.25 * radius * along
    body = [neck, wall, wall + base, -wall + base, -wall, -neck]
    return np.asarray(cap + np.array([*body, top - neck, top + neck, neck, -neck]))


def slice_corners(throw: Scenario, r: FloatArray, cap: FloatArray, along: FloatArray) -> FloatArray:
    """Return the corners of the slices at ``r``, shape (n, 4, 2) [m]; the drawn ones are as high as all together."""
    height = throw.slice_height * throw.n_slices / max(len(r), 1)
    half, wall = height / 2 * along, 0.94 * throw.bottle.radius * _across(along)
    corner = np.array([-half - wall, half - wall, half + wall, -half + wall])
    return np.asarray((cap + r[:, np.newaxis] * along)[:, np.newaxis, :] + corner)


def _trace(axes: Axes, film: Film, quantity: str) -> Line2D:
    """Draw one quantity of all flights over time; return the cursor."""
    for k, flight in enumerate(film.flights):
        values = flight.omega if quantity == "omega" else np.degrees(flight.theta)
        style = solver_style(flight.name, k)
        # The thinner line above: of two that agree both are seen.
        axes.plot(flight.t, values, zorder=3.0 - 0.1 * style["linewidth"], **style)
    axes.set_xlabel("time t [s]")
    axes.set_ylabel("ω [rad/s]" if quantity == "omega" else "θ [degrees]")
    axes.margins(x=0.01)
    if quantity == "omega" and axes.get_ylim()[0] > 0:
        axes.set_ylim(bottom=0.0)
    return axes.axvline(0.0, color="black", linewidth=1.0)
