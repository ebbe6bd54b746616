"""Guests: solvers of other people, certified and held against the ladder; in a report that is asked for some."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flipproof.chapters.differences.study import Difference
from flipproof.chapters.guests.study import Guest, Guests, Split, study
from flipproof.chapters.waterfall.chapter import DOWN, UP, WHOLE
from flipproof.figures.style import ASSUMPTIONS, MARKERS, new_figure, shared_legend, solver_style, styled
from flipproof.foreign.certify import findings_of
from flipproof.frame.chapter import Absent, Band, Chapter, Exhibit, Finding, Kind, observed, regression
from flipproof.frame.equations import NAMES
from flipproof.output.columns import curves_csv, rows_csv
from flipproof.output.tables import trajectory_csv
from slicemodel import Trajectory
from slicemodel.scenario import shortened

FLOOR: Final = 1e-12
"""Least difference that is drawn [omega_0]."""


def claim_guests(found: Guests) -> Iterator[Finding]:
    """Yield each check of every guest's certificate, and how far each is from every equation."""
    for guest in found.guests:
        head, label, visit = f"guest-{guest.slug}", guest.label, guest.visit
        if visit.certificate is not None:
            yield from findings_of(visit.certificate, f"{head}-certify-", f"{label}: ")
        for name, reason in visit.problems.items():
            kind: Kind = "observation" if name in ("content", "certificate", "waterfall") else "regression"
            yield Absent(f"{head}-{name.replace(' ', '-')}-missing", f"{label}: {name}", reason, kind).finding
        for rung, difference in guest.differences.items():
            title, note = f"{label} and {rung}: largest difference in ω", f"at t = {difference.largest_time:.4g} s"
            band = Band.of(difference.band, "twins and refinement")
            yield observed(f"{head}-{rung}", title, difference.largest, "of ω₀", note, band=band)
        if (rung := placed_on(guest)) in guest.differences:
            yield _claim_flight(guest, f"{head}-flight", guest.differences[rung])
        if guest.split is not None:
            split = guest.split
            parts = ", ".join(f"{NAMES[name]} {share:+.3g}" for name, share in split.bars.items()) or "none"
            title = f"{label}: mean of ω/ω₀ over the second half, free flight minus it"
            note = f"fair shares of what {split.equation} assumes: {parts}; the rest {split.rest:+.2g}"
            band = Band.of(guest.band, "refinement")
            yield observed(f"{head}-waterfall", title, split.end - split.start, "", note, band=band)
        if visit.ice is not None:
            yield observed(f"{head}-ice", f"{label}: drift of ω in ice on this throw", visit.ice.largest, "of ω₀")
        if guest.rise is not None:
            title = f"{label}: largest rise of the energy between two output times"
            yield observed(f"{head}-energy", title, guest.rise, "of E(0)")


def placed_on(guest: Guest) -> str:
    """Return the rung that a guest declares, or else that it was placed on; empty if neither is known."""
    visit = guest.visit
    if visit.traits is not None and visit.traits.equation is not None:
        return visit.traits.equation
    results = () if visit.certificate is None else visit.certificate.results
    places = [r.found.facts["place"] for r in results if r.found is not None and "place" in r.found.facts]
    return str(places[0]["equation"]) if places and places[0]["on_lattice"] else ""


def _claim_flight(guest: Guest, id_: str, difference: Difference) -> Finding:
    """Return the claim that the flight shown is that of the guest's equation, as far as its own error explains."""
    if guest.band is None:
        room, own = 0.09, "it cannot be refined"
    else:
        room, own = (
            1e-3 + 5 * (difference.band or 0.0),
            f"its own change between its finest efforts is {guest.band:.2g}",
        )
    slices = guest.run.scenario.n_slices if guest.run is not None else 0
    title = f"{guest.label}: largest difference in ω from {difference.first}, the equation it was placed on"
    note = f"N = {slices}, t = {difference.largest_time:.4g} s; {own}"
    return regression(id_, title, difference.largest, "of ω₀", (0.0, room), note)


def draw_guests(found: Guests) -> Iterator[Exhibit]:
    """Yield the figures of the guests that flew, six at the most; the tables have them all."""
    flown = [guest for guest in found.guests if guest.run is not None][:6]
    if flown:
        more = "" if len(flown) == len(found.guests) else f" Drawn are {len(flown)} of {len(found.guests)} guests."
        yield _draw_omega(flown, found.ladder, more)
    if apart := [guest for guest in flown if guest.differences]:
        yield _draw_differences(apart)
    if placed := [(guest, guest.split) for guest in flown if guest.split is not None]:
        yield _draw_waterfalls(placed)
    if refined := [guest for guest in flown if len(guest.errors) > 1]:
        yield _draw_convergence(refined)
    if kept := [guest for guest in flown if guest.visit.ice is not None or guest.energy is not None]:
        yield _draw_ice_energy(kept)


def _draw_omega(flown: Sequence[Guest], ladder: Mapping[str, Trajectory], more: str) -> Exhibit:
    guests = {guest.label: guest.run for guest in flown if guest.run is not None}
    curves = {name: (run.t, run.omega / run.scenario.omega0) for name, run in {**guests, **ladder}.items()}
    ends = ", ".join(f"{name} {omega[-1]:.3f}" for name, (_, omega) in curves.items())
    return Exhibit(
        name="guests-omega",
        title="Angular velocity of the guests and of the ladder",
        caption=f"Broken lines are the equations of the ladder, solid lines the guests at their finest effort.{more}",
        alt=f"Line plot of omega over omega_0 against time. Values at the end: {ends}.",
        maker=figure_omega,
        data=(guests, dict(ladder)),
        table=curves_csv({f"omega/omega_0 {name} [1]": curve for name, curve in curves.items()}),
    )


@styled
def figure_omega(guests: dict[str, Trajectory], ladder: dict[str, Trajectory]) -> Figure:
    """Angular velocity of guests over that of the ladder, three of whose equations have their own colours."""
    figure, axes = new_figure(size=(8.0, 4.6))
    shown = ("published-limit", "eq8", "free-flight")
    for k, (name, run) in enumerate(ladder.items()):
        colour, dashes = solver_style(name)["color"] if name in shown else "#aaaaaa", (0, (4, 1 + k))
        axes.plot(run.t, run.omega / run.scenario.omega0, color=colour, linestyle=dashes, linewidth=1.0, label=name)
    for k, (name, run) in enumerate(guests.items()):
        axes.plot(run.t, run.omega / run.scenario.omega0, color=ASSUMPTIONS[k], linewidth=1.8, label=name)
    axes.set(xlabel="time t [s]", ylabel="angular velocity ω / ω₀ [1]")
    axes.margins(x=0.01)
    shared_legend(figure, axes)
    return figure


def _draw_differences(guests: Sequence[Guest]) -> Exhibit:
    words = []
    for guest in guests:
        to = guest.differences.get(guest.equation or "")
        words.append(f"{guest.label}: " + ("none" if to is None else f"{to.first} {to.largest:.2g} of omega_0"))
    curves = {
        f"difference {guest.label} {rung} [omega_0]": (difference.t, difference.omega)
        for guest in guests
        for rung, difference in guest.differences.items()
    }
    return Exhibit(
        name="guests-differences",
        title="How far each guest is from every equation",
        caption="One panel a guest. The dotted line is the guest's own band, the largest change of ω between its two "
        "finest efforts: a difference above it is not explained by refinement.",
        alt="Logarithmic line plots of the difference in omega to each equation. To the declared or nearest one: "
        f"{'; '.join(words)}.",
        maker=figure_differences,
        data=(guests,),
        table=curves_csv(curves),
    )


@styled
def figure_differences(guests: Sequence[Guest]) -> Figure:
    """Difference of each guest to every equation over time, a panel a guest."""
    figure, grid = new_figure(len(guests), size=(8.0, 1.4 + 2.4 * len(guests)), sharex=True, squeeze=False)
    for axes, guest in zip(grid[:, 0], guests, strict=True):
        for k, (rung, difference) in enumerate(guest.differences.items()):
            size = np.maximum(np.abs(difference.omega), FLOOR)
            axes.semilogy(difference.t, size, color=ASSUMPTIONS[k % len(ASSUMPTIONS)], linewidth=1.2, label=rung)
        if guest.band is not None:
            axes.axhline(max(guest.band, FLOOR), color="#444444", linestyle=":", linewidth=1.0)
        axes.set_title(guest.label, fontsize=10, loc="left")
        axes.set_ylabel("|Δω| / ω₀ [1]")
        axes.margins(x=0.01)
    grid[-1, 0].set_xlabel("time t [s]")
    shared_legend(figure, grid[0, 0], columns=4)
    return figure


def _draw_convergence(guests: Sequence[Guest]) -> Exhibit:
    rows = (
        (guest.slug, guest.equation, repr(one.effort), f"{one.seconds:.4g}", error)
        for guest in guests
        for one, error in zip(guest.visit.efforts, guest.errors, strict=True)
    )
    words = "; ".join(f"{guest.label}: {guest.errors[0]:.2g} to {guest.errors[-1]:.2g} of omega_0" for guest in guests)
    return Exhibit(
        name="guests-convergence",
        title="What refinement buys each guest",
        caption="Largest difference in ω to the guest's own equation, or to the nearest if it declares none, against "
        "its effort relative to the coarsest run. A curve that levels off has met another equation, another parameter, "
        "or its arithmetic.",
        alt=f"Log-log plot of error against effort. {words}.",
        maker=figure_convergence,
        data=(guests,),
        table=rows_csv(("guest", "equation", "effort", "seconds", "error [omega_0]"), rows),
    )


@styled
def figure_convergence(guests: Sequence[Guest]) -> Figure:
    """Error against effort."""
    figure, axes = new_figure(size=(8.0, 4.2))
    for k, guest in enumerate(guests):
        efforts = np.array([one.effort for one in guest.visit.efforts], dtype=float)
        counted = guest.visit.traits is not None and guest.visit.traits.refined_by == "steps"
        work, errors = efforts / efforts[0] if counted else efforts[0] / efforts, np.maximum(guest.errors, FLOOR)
        look = {"marker": MARKERS[k % len(MARKERS)], "color": ASSUMPTIONS[k]}
        axes.loglog(work, errors, label=f"{guest.label} → {guest.equation}", **look)
    axes.set(xlabel="effort relative to the coarsest run [1]", ylabel="max |ω − ω of the equation| / ω₀ [1]")
    shared_legend(figure, axes, columns=2)
    return figure


def _draw_ice_energy(guests: Sequence[Guest]) -> Exhibit:
    words, curves = [], {}
    for guest in guests:
        ice, run = guest.visit.ice, guest.run
        drift = "not given" if ice is None else f"{ice.largest:.2g}"
        rise = "not given" if guest.rise is None else f"{guest.rise:.2g}"
        words.append(f"{guest.label}: drift in ice {drift}, largest rise of energy {rise}")
        if ice is not None:
            curves[f"ice drift {guest.label} [1]"] = ice.t, ice.drift
        if guest.energy is not None and run is not None:
            curves[f"E/E(0) {guest.label} [1]"] = run.t, guest.energy
    return Exhibit(
        name="guests-ice-energy",
        title="Ice and energy",
        caption="Left: in a bottle of ice every drift of ω is an error of the solver. Right: energy in the frame of "
        "the centre of mass. In free flight drag and impacts only take energy away; in Eq. 8 the weight may add some.",
        alt=f"Drift in ice and energy over time. {'; '.join(words)}.",
        maker=figure_ice_energy,
        data=(guests,),
        table=curves_csv(curves),
    )


@styled
def figure_ice_energy(guests: Sequence[Guest]) -> Figure:
    """Drift in ice (left), energy (right)."""
    figure, panels = new_figure(1, 2, size=(8.0, 4.0))
    for guest, colour in zip(guests, ASSUMPTIONS, strict=False):
        if guest.visit.ice is not None:
            drift = np.maximum(guest.visit.ice.drift, 1e-18)
            panels[0].semilogy(guest.visit.ice.t, drift, color=colour, linewidth=1.4, label=guest.label)
        if guest.energy is not None and guest.run is not None:
            panels[1].plot(guest.run.t, guest.energy, color=colour, linewidth=1.4, label=guest.label)
    for axes, label in zip(panels, ("|ω / ω₀ − 1| in ice [1]", "energy E / E(0) [1]"), strict=True):
        axes.set(ylabel=label, xlabel="time t [s]")
        axes.margins(x=0.01)
    shared_legend(figure, panels[0] if any(g.visit.ice is not None for g in guests) else panels[1], columns=3)
    return figure


def _draw_waterfalls(placed: Sequence[tuple[Guest, Split]]) -> Exhibit:
    words: list[str] = []
    rows: list[tuple[Any, ...]] = []
    for guest, split in placed:
        parts = ", ".join(f"{NAMES[name]} {share:+.3f}" for name, share in split.bars.items())
        ends = f"from {split.start:.3f} to {split.end:.3f}" + (f" by {parts}" if parts else "")
        words.append(f"{guest.label}: {ends}, the rest {split.rest:+.2g}")
        head = guest.slug, split.equation
        rows += [(*head, "(the guest)", split.start, None, None), (*head, "the rest", split.rest, None, None)]
        rows += [(*head, NAMES[name], share, *split.ranges[name]) for name, share in split.bars.items()]
        rows.append((*head, "(free flight)", split.end, None, None))
    return Exhibit(
        name="guests-waterfall",
        title="Waterfall of each guest",
        caption="Left: from the guest's mean of ω/ω₀ over the second half to that of free flight. The hatched bar is "
        "the rest, which leads to the equation that the guest solves and which no assumption explains; its error bar "
        "is the guest's own band. Every other bar is the fair share of an assumption of that equation, the mean over "
        "all orders of mending them; blue raises, orange lowers. Rest and shares sum to the whole difference. Right: "
        "the rest (square) and the shares (dots) again, the shares with their range over single orders; where it is "
        "wide, assumptions interact.",
        alt=f"Waterfall of the mean of omega over omega_0 in the second half. {'; '.join(words)}.",
        maker=figure_waterfalls,
        data=(placed,),
        table=rows_csv(
            ("guest", "equation", "step", "fair share [1]", "least of all orders [1]", "largest of all orders [1]"),
            rows,
        ),
    )


@styled
def figure_waterfalls(placed: Sequence[tuple[Guest, Split]]) -> Figure:
    """Left: rest and shares, each bar from the value before to the value after. Right: shares with their ranges."""
    counts = [len(split.bars) + 3 for _, split in placed]
    size = (8.0, 0.7 + sum(0.55 + 0.36 * count for count in counts))
    shape: dict[str, Any] = {"squeeze": False, "width_ratios": (1.5, 1.0), "height_ratios": counts}
    figure, grid = new_figure(len(placed), 2, size=size, sharex="col", sharey="row", **shape)
    for (ladder, orders), (guest, split) in zip(grid, placed, strict=True):
        _panels(ladder, orders, split, guest.band)
        ladder.set_title(shortened(guest.label[::-1], 80)[::-1], fontsize=10, loc="left")
    grid[-1, 0].set_xlabel("mean of ω/ω₀ over the second half [1]")
    grid[-1, 1].set_xlabel("change [1]")
    return figure


def _panels(ladder: Axes, orders: Axes, split: Split, band: float | None) -> None:
    names = ["the guest", f"the rest, to {split.equation}", *(NAMES[name] for name in split.bars), "free flight"]
    places = list(range(len(names), 0, -1))
    beside: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "fontsize": 9}
    grey: dict[str, Any] = {"color": "#888888", "linewidth": 0.8}
    for place, value, away in ((places[0], split.start, 8), (places[-1], split.end, -16)):
        ladder.plot(value, place, "D", color=WHOLE, markersize=8)
        ladder.annotate(f"{value:.4f}", (value, place), xytext=(0, away), **beside)
    level = split.start
    ladder.plot([level, level], [places[1] + 0.3, places[0]], **grey)
    for place, (name, share) in zip(places[1:-1], [("", split.rest), *split.bars.items()], strict=True):
        colour = UP if share >= 0 else DOWN
        look: dict[str, Any] = {"color": colour} if name else {"color": "none", "edgecolor": colour, "hatch": "////"}
        ladder.barh(place, share, left=level, height=0.6, xerr=None if name else band, capsize=3, **look)
        level += share
        ladder.plot([level, level], [place - 1.0 + (0.3 if place > 2 else 0.0), place + 0.3], **grey)
        ends = split.ranges.get(name, (share, share))
        orders.plot(ends, [place, place], color="#BBBBBB", linewidth=4.0, solid_capstyle="butt")
        orders.plot(share, place, "o" if name else "s", color="black" if name else WHOLE, markersize=6)
        said = f"{share:+.2g}".replace("-", "\N{MINUS SIGN}")
        orders.annotate(said, (share, place), xytext=(0, 6), **beside)
    ladder.set_yticks(places, names)
    ladder.set_ylim(0.1, places[0] + 0.9)
    orders.axvline(0.0, color="#444444", linewidth=0.8)
    for axes in (ladder, orders):
        axes.use_sticky_edges = False
        axes.margins(x=0.12)
        axes.grid(visible=False, axis="y")


def page(found: Guests) -> dict[str, Any]:
    """Return the guests of each table, and the words of every assumption."""
    names = () if found.agreement is None else found.agreement.names
    return {
        "compared": [guest for guest in found.guests if guest.label in names],
        "splits": [guest for guest in found.guests if guest.split is not None],
        "assumptions": NAMES,
    }


def summarise(guest: Guest) -> dict[str, Any]:
    """Return a guest as JSON-ready data."""
    visit, split = guest.visit, guest.split
    waterfall: dict[str, Any] | None = None
    if split is not None:
        waterfall = {"equation": split.equation, "guest": split.start, "free-flight": split.end, "rest": split.rest}
        waterfall |= {"bars": dict(split.bars), "ranges": {name: list(ends) for name, ends in split.ranges.items()}}
    return {
        "spec": visit.spec,
        "content": visit.content,
        "name": guest.label,
        "equation": guest.equation,
        "passport": None if visit.certificate is None else visit.certificate.to_mapping(),
        "problems": dict(visit.problems),
        "band": guest.band,
        "differences": {
            rung: {"largest": d.largest, "time": d.largest_time, "final": d.final, "band": d.band}
            for rung, d in guest.differences.items()
        },
        "efforts": [
            {"effort": one.effort, "seconds": round(one.seconds, 4), "error": error}
            for one, error in zip(visit.efforts, guest.errors, strict=True)
        ],
        "waterfall": waterfall,
        "ice_drift": None if visit.ice is None else visit.ice.largest,
        "energy_rise": guest.rise,
    }


def tables(found: Guests) -> dict[str, str]:
    """Return the trajectory of every guest as CSV."""
    flown = {guest.slug: guest.run for guest in found.guests if guest.run is not None}
    return {f"trajectories/guest-{slug}/data.csv": trajectory_csv(run) for slug, run in flown.items()}


CHAPTER: Final = Chapter(
    name="guests",
    title="Guests",
    study=study,
    claims=claim_guests,
    kind="regression",
    figures=draw_guests,
    work={},
    summary=lambda found: {"guests": [summarise(guest) for guest in found.guests]},
    tables=tables,
    page=page,
)
