r"""The reduced flow: between two impacts the flight of any number of slices is seven scalar equations.

    y = r - L/2            cap: y = -wall                                    base: y = +wall
                              |---- o ---- o ------- y_c ------ o -- o -- o -|
                                    mean of the free slices = y_c + z

Every free slice obeys y_i'' = k^2 y_i - d y_i' + f(t) with k, d and f common to all. With the two solutions A and B of
the homogeneous equation that start as (A, A', B, B') = (1, 0, 0, 1), and (u_i, w_i) place and speed at that time,

    y_i = y_c + z + A (u_i - mean u) + B (w_i - mean w)
    J   = J_c + m (A^2 U + 2 A B P + B^2 V) + (a M_c / M) z^2,      theta' = omega = L / J

where y_c, J_c, M_c are centre, inertia and mass of the tube with the slices that rest in it, a is the mass of the free
slices, and U, P, V are the central moments of (u, w). theta, A, A', B, B', z, z' are advanced by their Taylor series;
an impact moves one point (u_i, w_i) and changes the moments by rank one. ``docs/theory.md`` derives it.

layout    the numbers of one flight, and the constants of the equation of z       series    Taylor coefficients
points    the map, its moments, and how a slice enters and leaves them             search    the first event of a step
laws      which impulses act                                                       contacts  rebound, rest, release
ledger    the works of the terms of the equation                                   loop      one flight
api       scenarios in, trajectories out; compiles the loop on first use

Only ``loop``, and what it imports, loads numba.
"""
